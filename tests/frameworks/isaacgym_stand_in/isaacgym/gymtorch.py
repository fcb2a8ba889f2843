def wrap_tensor(tensor):
    return tensor


unwrap_tensor = wrap_tensor
