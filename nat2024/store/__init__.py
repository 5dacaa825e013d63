"""Results on disk: text is the truth, everything else can be made again.

```
RESULTS/DATASET/RUN/SEQUENCE.txt        x,y,w,h a line, one line a frame
RESULTS/DATASET/RUN/time/SEQUENCE.csv   read,enhance,track seconds a frame
RESULTS/DATASET/RUN/skipped/SEQUENCE.csv  numbers of the frames that were skipped, if any
RESULTS/DATASET/RUN/backends/SEQUENCE.json  backends that took over, if any
RESULTS/DATASET/RUN/run.json            manifest
```

RUN is `TRACKER[@LABEL][+ENHANCER[@LABEL]]`. A file that exists is whole; a run folder belongs to
one set of options, weights and scope.

Runs of other toolkits are found and read beside them, as they lie (`nat2024.importing`).
"""

from nat2024.store.manifests import (
    FORMAT,
    DatasetRecord,
    ImportRecord,
    Manifest,
    OnBadFrame,
    PluginRecord,
    Session,
    StageTimes,
    WeightsRecord,
    run_name,
    split_run_name,
)
from nat2024.store.opening import open_run, setting_differences
from nat2024.store.runs import STAGES, Run, RunFolder, Track
from nat2024.store.sources import (
    check_results,
    dataset_folder,
    list_datasets,
    list_runs,
)

__all__ = [
    "FORMAT",
    "STAGES",
    "DatasetRecord",
    "ImportRecord",
    "Manifest",
    "OnBadFrame",
    "PluginRecord",
    "Run",
    "RunFolder",
    "Session",
    "StageTimes",
    "Track",
    "WeightsRecord",
    "check_results",
    "dataset_folder",
    "list_datasets",
    "list_runs",
    "open_run",
    "run_name",
    "setting_differences",
    "split_run_name",
]
