# One image for the web process and for the worker; docker-compose.yml starts one of each.

# The digest is that of Python 3.13.16 for all processors. For the present one of the tag, ask its registry:
# docker buildx imagetools inspect python:3.13-slim-trixie
ARG BASE=python:3.13-slim-trixie@sha256:bb2988715db2cf7ace7b53f38f3cffbef7c7046a656bee66245eb0ed386e2e81

FROM ${BASE} AS build
WORKDIR /src
COPY . .
RUN ./dev wheel --out-dir /wheel

FROM ${BASE}
COPY requirements/run.txt /tmp/requirements.txt
RUN pip install --no-cache-dir --require-hashes -r /tmp/requirements.txt
COPY --from=build /wheel /tmp/wheel
RUN pip install --no-cache-dir --no-deps /tmp/wheel/*.whl \
    && useradd --create-home --uid 1000 gainline \
    && install --directory --owner=gainline /var/lib/gainline
USER 1000
# The compiled kernels are kept beside the data: a new container starts as fast as an old one.
ENV GAINLINE_DATA_DIR=/var/lib/gainline \
    NUMBA_CACHE_DIR=/var/lib/gainline/kernels
VOLUME /var/lib/gainline
EXPOSE 8000
STOPSIGNAL SIGTERM
CMD ["gainline", "serve", "--host", "0.0.0.0"]
