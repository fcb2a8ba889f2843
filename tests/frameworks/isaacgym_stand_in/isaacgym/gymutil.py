import argparse

from isaacgym import gymapi


def parse_device_str(device):
    kind, _, number = device.partition(":")
    return kind, int(number or 0)


def parse_sim_config(config, params):
    for name, value in config.items():
        if isinstance(value, dict):
            parse_sim_config(value, getattr(params, name))
        else:
            setattr(params, name, value)


def parse_arguments(description, custom_parameters):
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--sim_device", default="cpu")
    for options in custom_parameters:
        options = dict(options)
        parser.add_argument(options.pop("name"), **options)
    arguments = parser.parse_args()
    arguments.sim_device_type, arguments.compute_device_id = parse_device_str(arguments.sim_device)
    arguments.physics_engine, arguments.use_gpu = gymapi.SIM_PHYSX, False
    arguments.use_gpu_pipeline, arguments.subscenes, arguments.num_threads = False, 0, 0
    return arguments
