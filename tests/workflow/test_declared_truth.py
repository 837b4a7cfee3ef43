"""Jobs of a coupled truth, of a hand of one muscle: they read what their rules declare."""

import json
from pathlib import Path

import pytest
import yaml

from handpipe.core import paths

from .running import run, watching, working_copy
from .thin_hand import TRUTH_RULES, thin_hand, thin_out

PATTERNS = (paths.metrics_of("truth"), paths.DATA_TEMPLATES, paths.DATA_VOLUME)


@pytest.mark.slow
def test_jobs_read_no_file_that_their_rules_do_not_declare(tmp_path: Path) -> None:
    folder = working_copy(tmp_path / "copy")
    thin_out(folder)
    text = yaml.safe_dump(thin_hand("whole"), sort_keys=False)
    (folder / "config/datasets/whole.yaml").write_text(text, encoding="utf-8")
    (folder / "watched").mkdir()
    targets = [str(paths.at(pattern, subject="whole", pose="neutral")) for pattern in PATTERNS]
    process = run(folder, "-j2", *targets, environment=watching(folder / "watched"))
    assert process.returncode == 0, process.stdout[-5000:]
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in (folder / "watched").glob("*.json")]
    assert {job["rule"] for job in jobs} == TRUTH_RULES
    assert [job for job in jobs if job["undeclared"]] == []
