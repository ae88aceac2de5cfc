//! The visage binary.

fn main() -> std::process::ExitCode {
    visage::cli::main()
}
