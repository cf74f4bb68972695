//! The `lacuna` command.

fn main() -> std::process::ExitCode {
    lacuna_api::cli::main()
}
