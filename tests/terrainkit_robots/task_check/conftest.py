import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch

torch.set_num_threads(1)
