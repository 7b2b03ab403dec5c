# Thin on purpose: what is checked, and how, is `cargo xtask`.

# rustup's folder, for shells that were opened before it was installed.
export PATH := $(PATH):$(HOME)/.cargo/bin

REPORT := $(CURDIR)/out/demo

.PHONY: demo web test bench soak check fmt

# The whole loop on the built-in scene and a report of it; then the page, served on this machine (not with CI set).
demo:
	@bash scripts/setup.sh
	cargo run --release --package dapple -- eval --out out/demo
	@echo
	@echo "The report: file://$(REPORT)/report.html"
	@if [ -z "$$CI" ]; then cargo xtask wasm && cargo run --release --package dapple -- demo; fi

# The page, into target/web, for any static server.
web:
	@bash scripts/setup.sh web
	cargo xtask wasm

# All checks and tests; what CI runs.
test:
	@bash scripts/setup.sh test
	cargo xtask ci

# Rays a second beside other tracers (EMBREE_LIB: crates/trace/benches/rays/README.md), what a step of the server costs,
# and what looking visibility up costs on this machine's adapter: target/bench.json.
bench:
	@bash scripts/setup.sh
	cargo bench --package dapple-trace --bench rays
	cargo bench --package dapple-server --bench step
	cargo bench --package dapple --bench lookup

# A live server under viewers that come, go, break off, stall and move things; SECONDS=60 for a minute.
SECONDS ?= 600
soak:
	@bash scripts/setup.sh
	cargo run --release --package dapple -- bench soak --seconds $(SECONDS)

check:
	cargo xtask check

fmt:
	cargo fmt --all
