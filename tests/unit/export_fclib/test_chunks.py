"""Files of a series: whatever stays, moves, grows or shrinks between two of them, each is what it would be alone."""

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fcsim.export_fclib import chunks, read_fclib, write_fclib
from fcsim.export_fclib.chunks import Compressor
from fcsim.problem import GlobalProblem


@pytest.fixture
def deflations(monkeypatch):
    """The sizes [entries] of the chunks that were compressed."""
    sizes, compressed = [], chunks._compressed

    def counted(chunk, size):
        sizes.append(len(chunk))
        return compressed(chunk, size)

    monkeypatch.setattr(chunks, "_compressed", counted)
    return sizes


def written(compressor, values, name="x"):
    """The data set as HDF5 reads it, and its bytes before."""
    with h5py.File("series", "w", driver="core", backing_store=False) as file:
        compressor.write(file.create_group("M"), name, values)
        dataset = file["M"][name]
        assert (dataset.dtype, dataset.shape, dataset.shuffle, dataset.compression) == (values.dtype, values.shape, True, "gzip")
        return dataset[()].tobytes()


@pytest.mark.parametrize("dtype", [np.int32, np.float64])
@pytest.mark.parametrize("size", [1, 5, chunks.ENTRIES - 1, chunks.ENTRIES, chunks.ENTRIES + 1, 2 * chunks.ENTRIES + 77])
def test_chunks_are_those_of_the_filters_of_hdf5(size, dtype):
    """HDF5's own pipeline, asked for the same chunks, stores the same entries in the same number of chunks."""
    values = (1e6 * np.random.default_rng(3).standard_normal(size)).astype(dtype)
    assert written(Compressor(), values) == values.tobytes()
    with h5py.File("both", "w", driver="core", backing_store=False) as file:
        Compressor().write(file, "own", values)
        shape = (min(size, chunks.ENTRIES),)
        file.create_dataset("reference", data=values, chunks=shape, shuffle=True, compression="gzip", compression_opts=chunks.LEVEL)
        own, reference = file["own"].id, file["reference"].id
        assert own.get_num_chunks() == reference.get_num_chunks()
        plist, expected = own.get_create_plist(), reference.get_create_plist()
        assert [plist.get_filter(k) for k in range(plist.get_nfilters())] == [
            expected.get_filter(k) for k in range(expected.get_nfilters())
        ]
        for k in range(own.get_num_chunks()):
            assert own.get_chunk_info(k).chunk_offset == reference.get_chunk_info(k).chunk_offset
            assert own.get_chunk_info(k).filter_mask == 0


def test_only_what_changed_is_compressed(deflations):
    compressor, values = Compressor(), np.random.default_rng(0).standard_normal(3 * chunks.ENTRIES + 10)
    assert written(compressor, values) == values.tobytes()
    assert deflations == [chunks.ENTRIES] * 3 + [10]
    deflations.clear()
    assert written(compressor, values.copy()) == values.tobytes() and deflations == []
    values[chunks.ENTRIES + 5] = np.nextafter(values[chunks.ENTRIES + 5], 1)
    values[-1] = -values[-1]
    assert written(compressor, values) == values.tobytes()
    assert deflations == [chunks.ENTRIES, 10]


def test_equal_numbers_of_other_bits_are_not_the_same(deflations):
    compressor, zeros = Compressor(), np.zeros(6)
    for values in (zeros, -zeros, zeros.astype(np.int64), zeros[:5], np.zeros(12, dtype=np.int32)):
        assert written(compressor, values) == values.tobytes()
    assert len(deflations) == 5


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_series_comes_back(data):
    """Arrays of few different numbers and of lengths about those of the chunks: what is remembered is often right and often not."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunks, "ENTRIES", 4)
        compressor = Compressor()
        for _ in range(data.draw(st.integers(2, 6))):
            kind = data.draw(st.sampled_from([np.int32, np.float64]))
            values = np.array(data.draw(st.lists(st.integers(0, 1), min_size=1, max_size=13)), dtype=kind)
            assert written(compressor, values, data.draw(st.sampled_from("ix"))) == values.tobytes()


def test_problems_of_a_series(tmp_path, deflations):
    """M stays and is compressed once, the entries of H in every file; each file is that of its problem alone."""
    rng = np.random.default_rng(1)
    M, compressor = rng.standard_normal((30, 30)), Compressor()
    for step in range(3):
        problem = GlobalProblem(M, rng.standard_normal((30, 6)), rng.standard_normal(30), rng.standard_normal(6), np.full(2, 0.5))
        deflations.clear()
        path = write_fclib(tmp_path / f"{step}.hdf5", problem, compression=compressor)
        assert deflations.count(900) == (2 if step == 0 else 0)  # M's i and x
        assert deflations.count(180) == (2 if step == 0 else 1)  # H's i and x, then x
        content = read_fclib(path).problem
        for name in ("M", "H"):
            assert getattr(content, name).toarray().tobytes() == getattr(problem, name).tobytes()
        assert content.f.tobytes() == problem.f.tobytes() and content.w.tobytes() == problem.w.tobytes()
