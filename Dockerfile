# The command line in a container; files are in the folder that is mounted at /work:
#   docker build -t terrainkit .
#   docker run --rm -v "$PWD:/work" terrainkit generate --rows 10 --cols 10 -o map.npz
# Not run yet: the machine on which this was written cannot load images.
FROM python:3.12-slim AS system
ENV PIP_NO_CACHE_DIR=1
# EGL and OSMesa render without a display.
RUN apt-get update && apt-get install -y --no-install-recommends git libegl1 libosmesa6 make \
    && rm -rf /var/lib/apt/lists/*

# .devcontainer mounts the clone and installs it.
FROM system AS development

FROM system
COPY . /terrainkit
WORKDIR /terrainkit
RUN pip install . && terrainkit generate --rows 10 --cols 10 -o map.npz
WORKDIR /work
ENTRYPOINT ["terrainkit"]
