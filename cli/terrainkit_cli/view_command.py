"""The command that shows a map in the browser."""

import socket
import time
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO

from terrainkit.errors import ConfigError
from terrainkit.terrain_map import TerrainMap
from terrainkit_cli import render
from terrainkit_cli.parse import Command
from terrainkit_cli.terrain_commands import MapFile


@dataclass(frozen=True, kw_only=True)
class View(Command):
    """Show a map in the browser, in 3D.

    The command prints the address and runs until Ctrl+C. It needs no display: with the default
    host, forward the port of a remote machine (ssh -L 8080:localhost:8080) and open the address.
    """

    map: MapFile
    """The map, a file written by terrainkit generate."""

    host: str = "localhost"
    """Address that the server listens on; 0.0.0.0 is reachable from other machines."""

    port: int = 8080
    """Port that the server listens on; the next free one if it is in use."""

    def run(self) -> int:
        """Serve the view until the command is interrupted."""
        try:
            import viser
        except ModuleNotFoundError:
            raise ConfigError(
                "view requires viser; install it with: pip install terrainkit[view]"
            ) from None
        from terrainkit.viewer import show_map

        if not 0 < self.port < 1 << 16:
            raise ConfigError(f"--port: got {self.port}; expected 1 to 65535")
        try:  # viser would wait forever for a server that cannot listen
            with socket.socket() as trial:
                trial.bind((self.host, 0))
        except OSError as error:
            raise ConfigError(
                f"--host: got {self.host}, which is not an address of this machine "
                f"({error.strerror}); expected localhost or 0.0.0.0"
            ) from None
        terrain_map = TerrainMap.load(self.map)
        with redirect_stdout(StringIO()):  # viser prints a banner
            server = viser.ViserServer(host=self.host, port=self.port, verbose=False)
        show_map(server, terrain_map)
        render.result(f"http://{self.host}:{server.get_port()} shows {self.map}; Ctrl+C ends it")
        try:
            while True:
                time.sleep(1.0)
        finally:
            server.stop()
