# Build with the toolchain that Cargo.toml asks for; run on a small image without a shell's worth of tools.
FROM node:22-bookworm-slim AS page
WORKDIR /src/web
COPY web/package.json web/package-lock.json web/.npmrc ./
RUN npm ci --no-audit --no-fund
COPY openapi.yaml /src/
COPY web ./
RUN npm run build

FROM rust:1.95-slim-bookworm AS build
# the slim image has the C compiler that SQLite and BLAKE3 need
WORKDIR /src
# dependencies and crates first: they don't change with the command line
COPY Cargo.toml Cargo.lock ./
COPY crates crates
COPY --from=page /src/web/dist web/dist
RUN mkdir src \
    && echo 'fn main() {}' > src/main.rs \
    && touch src/lib.rs \
    && cargo build --profile dist --locked -p visage --features tls,s3,postgres,otel \
    && rm -r src
COPY src src
RUN touch src/lib.rs src/main.rs \
    && cargo build --profile dist --locked -p visage --features tls,s3,postgres,otel \
    && mkdir /data

FROM gcr.io/distroless/cc-debian12:nonroot
COPY --from=build /src/target/dist/visage /usr/local/bin/visage
COPY --from=build --chown=nonroot:nonroot /data /data
# with glibc's own thresholds what many uploads took for a while stays with the process
ENV MALLOC_MMAP_THRESHOLD_=131072 \
    MALLOC_TRIM_THRESHOLD_=1000000 \
    VISAGE_ADDR=0.0.0.0:8080 \
    VISAGE_DATA_DIR=/data \
    VISAGE_LOG_FORMAT=json
VOLUME /data
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=5s --start-period=10s --retries=3 CMD ["/usr/local/bin/visage", "healthcheck"]
ENTRYPOINT ["/usr/local/bin/visage"]
CMD ["serve"]
