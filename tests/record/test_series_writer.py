"""Our writer of ``series.mcap`` against mcap's own."""

from io import BytesIO

from hypothesis import given
from hypothesis import strategies as st
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import IndexType, Writer

from onboard.record.series_writer import SeriesWriter

SCHEMAS = {"pose": b'{"title":"perchhw.pose"}', "cues": b"{}", "motors": b"{}"}
METADATA = ("perchhw.run", {"schema": "perchhw.run/1"})
Messages = list[tuple[str, int, bytes]]


def by_mcap(messages: Messages) -> bytes:
    stream = BytesIO()
    writer = Writer(stream, use_chunking=False, index_types=IndexType.NONE, enable_data_crcs=True)
    writer.start(profile="", library="perchhw")
    channels = {}
    for topic, schema in SCHEMAS.items():
        number = writer.register_schema(f"perchhw.{topic}", SchemaEncoding.JSONSchema, schema)
        channels[topic] = writer.register_channel(topic, MessageEncoding.JSON, number)
    writer.add_metadata(*METADATA)
    sequence = dict.fromkeys(SCHEMAS, 0)
    for topic, time_ns, data in messages:
        sequence[topic] += 1
        writer.add_message(channels[topic], time_ns, data, publish_time=time_ns, sequence=sequence[topic])
    writer.finish()
    return stream.getvalue()


@given(
    st.lists(
        st.tuples(st.sampled_from(list(SCHEMAS)), st.integers(0, 2**63), st.binary(max_size=40)), max_size=20
    )
)
def test_every_byte_is_that_of_mcaps_own_writer(messages: Messages) -> None:
    stream = BytesIO()
    writer = SeriesWriter(stream, SCHEMAS, METADATA)
    for message in messages:
        writer.add(*message)
    writer.finish()
    assert stream.getvalue() == by_mcap(messages)
