import shutil

import onnx
import pytest

from terrainkit_robots.policy.export import METADATA_KEY, export_policy
from terrainkit_robots.rl.run import open_run


@pytest.fixture(scope="session")
def all_forms(tmp_path_factory):
    """The bundled quadruped's policy with one form of its contract in each folder."""
    folder = tmp_path_factory.mktemp("forms")
    export_policy(open_run("quadruped"), folder / "export", deploy_yaml=True)
    model = onnx.load(folder / "export" / "policy.onnx")
    for form in ("mjlab", "yaml", "script"):
        (folder / form).mkdir()
    kept = [each for each in model.metadata_props if each.key != METADATA_KEY]
    del model.metadata_props[:]
    onnx.save(model, folder / "yaml" / "policy.onnx")
    model.metadata_props.extend(kept)
    onnx.save(model, folder / "mjlab" / "policy.onnx")
    shutil.copy(folder / "export" / "policy.pt", folder / "script")
    for form in ("yaml", "script"):
        shutil.copy(folder / "export" / "deploy.yaml", folder / form)
    return folder
