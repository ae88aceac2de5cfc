# What is done often; `just` lists it. .ci/run does all of it and the contract checks.

# the folder of real data for the ignored tests
export VISAGE_DATA := absolute_path(env("VISAGE_DATA", "../shared/data"))

_list:
    @just --list

# formatting, lints, tests
check:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets --locked -- -D warnings
    cargo test --workspace --locked

# doc comments: broken links are errors
doc:
    RUSTDOCFLAGS="-D warnings -A rustdoc::private_intra_doc_links" \
        cargo doc --workspace --no-deps --document-private-items --locked

# the tests, with code-made data only
test *args:
    cargo test --locked {{args}}

# the tests on real data
real *args:
    cargo test --release --locked -p visage --test '*' {{args}} -- --ignored --skip long:: --nocapture

# write the contract anew after a change of the API
openapi:
    cargo run --release --locked --quiet -- openapi > openapi.yaml.new
    mv openapi.yaml.new openapi.yaml

# the page at `/` (needs Node.js): built, with its own tests; the next cargo build takes it in
web:
    cd web && npm ci --no-audit --no-fund && npm run build && npm test

# the page in Chromium, against the program that was built last
web-e2e *args:
    cd web && npm run e2e -- {{args}}

# everything on code-made scans; `just demo --keep` leaves the server up
demo *args:
    cargo run --release --locked -- demo {{args}}

# all that has to pass
ci:
    .ci/run

# known faults, licences and sources of what it is built of (cargo install cargo-deny cargo-audit)
audit:
    cargo deny --all-features check
    cargo deny --manifest-path examples/library/Cargo.toml --config deny.toml check
    cargo audit --deny warnings
    cargo audit --deny warnings --file examples/library/Cargo.lock

# what the program with all features and the page are made of, as CycloneDX (cargo install cargo-cyclonedx)
sbom:
    cargo cyclonedx --format json --features tls,s3,postgres,otel --describe binaries --target-in-filename
    cd web && npm sbom --sbom-format cyclonedx --omit dev > visage-page.cdx.json

# what takes too long for every change: hundreds of kills, disks that are full
long:
    .ci/long
