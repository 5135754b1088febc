"""Foxglove's own Python packages as judges of the scene file that Resight writes.

    python scripts/judges/mcap_scene.py [FILE.mcap]

Without a file (or with a folder, as judges of camera files are given) it is testdata/rig/scene.mcap, byte for byte what the writer writes.

Both readers of the package `mcap` (seeking by the indexes, and front to back) must find the same messages with every checksum right;
every message must decode by the schema in the file; every field of every schema in the file must have the name, number, type and label
of the one that Foxglove publishes in `foxglove-schemas-protobuf`. Needs mcap, mcap-protobuf-support, foxglove-schemas-protobuf.
"""

import importlib
import math
import pathlib
import struct
import sys
import zlib

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import NonSeekingReader, SeekingReader
from mcap_protobuf.decoder import DecoderFactory

DEFAULT = pathlib.Path(__file__).resolve().parents[2] / "testdata" / "rig" / "scene.mcap"


def published(full_name):
    """The descriptor of a foxglove message as the package has it."""
    module = importlib.import_module(f"foxglove_schemas_protobuf.{full_name.split('.')[1]}_pb2")
    return module.DESCRIPTOR.message_types_by_name[full_name.split(".")[1]]


def compare_schema(schema):
    """Field by field; returns how many fields were compared."""
    compared = 0
    for file in FileDescriptorSet.FromString(schema.data).file:
        if file.package != "foxglove":
            continue
        for message in file.message_type:
            theirs = published(f"foxglove.{message.name}")
            ours = {f.number: (f.name, f.type, f.label == 3, f.type_name.lstrip(".")) for f in message.field}
            wanted = {
                f.number: (f.name, f.type, f.is_repeated, (f.message_type or f.enum_type).full_name if f.message_type or f.enum_type else "")
                for f in theirs.fields
            }
            assert ours == wanted, (message.name, ours, wanted)
            enums = {e.name: [(v.name, v.number) for v in e.value] for e in message.enum_type}
            assert enums == {e.name: [(v.name, v.number) for v in e.values] for e in theirs.enum_types}, message.name
            compared += len(ours)
    return compared


def check_summary_crc(path):
    """The one checksum that the package does not verify itself."""
    data = path.read_bytes()
    footer = data[-8 - 20 : -8]
    summary_start, _, crc = struct.unpack("<QQI", footer)
    assert crc == zlib.crc32(data[summary_start:-12]) != 0, "summary checksum"


def check_messages(messages):
    """Frames form one tree from `rig`; rotations are rotations; clouds hold what their stride says."""
    frames, entities, clouds, calibrations = set(), set(), 0, 0
    for schema, _, _, decoded in messages:
        if schema.name == "foxglove.FrameTransforms":
            for t in decoded.transforms:
                q = t.rotation
                assert t.parent_frame_id == "rig" and math.isclose(q.x**2 + q.y**2 + q.z**2 + q.w**2, 1, abs_tol=1e-7)
                frames.add(t.child_frame_id)
        elif schema.name == "foxglove.SceneUpdate":
            for entity in decoded.entities:
                assert entity.frame_id == "rig" and entity.lines
                assert all(s.size.x >= s.size.y >= s.size.z > 0 for s in entity.spheres)
                entities.add(entity.id)
        elif schema.name == "foxglove.PointCloud":
            assert len(decoded.data) % decoded.point_stride == 0 and [f.name for f in decoded.fields] == ["x", "y", "z"]
            clouds += len(decoded.data) // decoded.point_stride
        elif schema.name == "foxglove.CameraCalibration":
            assert len(decoded.K) == 9 and len(decoded.P) == 12 and decoded.K[8] == 1 and decoded.width and decoded.height
            assert decoded.frame_id in frames, "a calibration's frame is placed before it is used"
            calibrations += 1
    return frames, entities, clouds, calibrations


def main():
    given = pathlib.Path(sys.argv[1]) if 1 < len(sys.argv) else DEFAULT
    path = DEFAULT if given.is_dir() else given
    with path.open("rb") as seeking, path.open("rb") as plain:
        reader = SeekingReader(seeking, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        by_index = list(reader.iter_decoded_messages(log_time_order=False))
        front_to_back = NonSeekingReader(plain, validate_crcs=True, decoder_factories=[DecoderFactory()])
        by_reading = list(front_to_back.iter_decoded_messages(log_time_order=False))
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    assert [m[2] for m in by_index] == [m[2] for m in by_reading] and by_index, "both readers find the same messages"
    assert summary.statistics.message_count == len(by_index)
    check_summary_crc(path)
    fields = sum(compare_schema(s) for s in summary.schemas.values())
    frames, entities, points, calibrations = check_messages(by_index)
    assert "command" in metadata["resight"]
    print(
        f"{path.name}: {len(by_index)} messages on {len(summary.channels)} topics, {fields} schema fields as published, "
        f"frames {sorted(frames)}, entities {sorted(entities)}, {points} points, {calibrations} calibrations"
    )


if __name__ == "__main__":
    main()
