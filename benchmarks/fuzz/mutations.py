"""Files that are nearly well-formed: seeds with some bytes changed, cut, moved or repeated."""

from hypothesis import strategies as st

_ODD = (
    b"\0", b"\xff", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"../", b"..\\",
    b"NaN", b"1e999", b"-1", b"9" * 40, b"null", b"[" * 50, b"\n", b",", b'"',
    b"\x1b[2J", b"\xe2\x80\xae",
)  # fmt: skip


@st.composite
def near(draw: st.DrawFn, seeds: tuple[bytes, ...]) -> bytes:
    """One of the seeds after at most six edits."""
    data = bytearray(draw(st.sampled_from(seeds)))
    for _ in range(draw(st.integers(0, 6))):
        place = draw(st.integers(0, len(data)))
        length = draw(st.integers(0, 8))
        edit = draw(st.sampled_from(("replace", "insert", "remove", "cut", "repeat", "flip")))
        new = draw(st.one_of(st.sampled_from(_ODD), st.binary(max_size=8)))
        if edit == "replace":
            data[place : place + len(new)] = new
        elif edit == "insert":
            data[place:place] = new
        elif edit == "remove":
            del data[place : place + length]
        elif edit == "cut":
            del data[place:]
        elif edit == "repeat":
            data[place:place] = data[max(0, place - 8 * length) : place]
        elif place < len(data):
            data[place] ^= 1 << (length % 8)
    return bytes(data)
