"""A batch that nobody had to run, packed in every format."""

from tests.apps.batch.test_pack import batch as batch
from tests.apps.batch.test_pack import make as make
from tests.apps.batch.test_pack import packed as packed
