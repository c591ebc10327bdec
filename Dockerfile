# docker build -t toonset . && docker run --rm -v "$PWD:/sheets" toonset calibrate sheet.png
# PyTorch without GPU libraries; what drawing synthetic sheets (`synth`) needs is there. Debian keeps
# one version of each of its packages: they are not pinned.
FROM python:3.13-slim-bookworm AS build
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends build-essential \
    && rm -rf /var/lib/apt/lists/*
COPY bootstrap.lock /source/
RUN python -m venv /opt/toonset \
    && /opt/toonset/bin/pip install --no-cache-dir --require-hashes --no-deps -r /source/bootstrap.lock
COPY . /source
RUN /opt/toonset/bin/python -m uv pip install --python /opt/toonset/bin/python --no-cache \
    --torch-backend=cpu /source

FROM python:3.13-slim-bookworm
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 artist
COPY --from=build /opt/toonset /opt/toonset
ENV PATH=/opt/toonset/bin:$PATH
USER 1000
WORKDIR /sheets
ENTRYPOINT ["toonset"]
CMD ["--help"]
