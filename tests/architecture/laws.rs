//! The laws of the house, as tables: which rooms there are, and what each may use.

/// Rooms of the house, each with those it may use. Arrows point one way: to rooms further up. Between crates Cargo holds them;
/// what it can't see are rooms inside a crate, and purity.
pub const LAYERS: &[(&str, &[&str])] = &[
    // pure
    ("geometry", &[]),
    ("registration", &["geometry"]),
    ("surface", &["geometry", "registration"]),
    ("saliency", &["geometry"]),
    ("descriptor", &["geometry", "saliency"]),
    ("faces", &["geometry", "saliency", "descriptor"]),
    ("standards", &["geometry", "saliency", "faces"]),
    ("gallery", &["geometry", "descriptor", "faces"]),
    ("synthetic", &["geometry"]),
    ("formats", &["geometry"]),
    ("picture", &["geometry"]),
    // a model as people see it
    ("report", &["geometry", "picture", "formats", "surface", "faces"]),
    // what is kept and what may be chosen: methods and hints, which holes are filled, signatures, standards
    ("domain", &["geometry", "registration", "surface", "formats", "faces", "standards"]),
    ("pipeline", &["geometry", "registration", "surface", "saliency", "descriptor", "formats", "faces", "domain"]),
    // around them: what the machine has, and files as memory
    ("machine", &[]),
    ("mapping", &[]),
    ("config", &["formats", "geometry", "machine"]),
    ("panics", &[]),
    ("traces", &[]),
    // records go in and come out; of the algorithms only which versions are current, of the settings where a bucket is
    ("storage", &["geometry", "faces", "standards", "domain", "config", "mapping"]),
    // use cases, the gallery index kept current, and what runs now
    (
        "app",
        &[
            "geometry",
            "formats",
            "faces",
            "standards",
            "gallery",
            "picture",
            "report",
            "pipeline",
            "domain",
            "config",
            "machine",
            "storage",
            "traces",
        ],
    ),
    (
        "jobs",
        &[
            "geometry",
            "formats",
            "faces",
            "standards",
            "pipeline",
            "domain",
            "config",
            "machine",
            "panics",
            "storage",
            "app",
        ],
    ),
    (
        "http",
        &[
            "geometry",
            "formats",
            "faces",
            "standards",
            "gallery",
            "picture",
            "report",
            "pipeline",
            "domain",
            "config",
            "panics",
            "storage",
            "traces",
            "app",
            "jobs",
        ],
    ),
    // the program: logs and commands
    ("telemetry", &["panics", "traces"]),
    (
        "cli",
        &[
            "geometry",
            "registration",
            "formats",
            "synthetic",
            "faces",
            "gallery",
            "picture",
            "report",
            "pipeline",
            "domain",
            "config",
            "machine",
            "telemetry",
            "traces",
            "app",
            "jobs",
            // what a data folder holds is looked through
            "storage",
            "http",
        ],
    ),
];

/// Algorithms: no HTTP, SQL, files, network, clock, environment, processes or printing.
pub const PURE: &[&str] = &[
    "geometry",
    "registration",
    "surface",
    "saliency",
    "descriptor",
    "faces",
    "standards",
    "gallery",
    "synthetic",
    "formats",
    "picture",
    "report",
    "domain",
    "pipeline",
];

/// What pure modules must not name.
pub const IMPURE_PATHS: &[&str] = &[
    "tokio",
    "axum",
    "sqlx",
    "reqwest",
    "tracing",
    "tempfile",
    "std::fs",
    "std::env",
    "std::io::stdin",
    "std::io::stdout",
    "std::io::stderr",
    "std::net",
    "std::os",
    "std::process",
    "std::thread",
    "std::time::Instant",
    "std::time::SystemTime",
];
/// The same, however they were imported.
pub const IMPURE_NAMES: &[&str] = &["Instant", "SystemTime"];
pub const PRINTING: &[&str] = &["print", "println", "eprint", "eprintln", "dbg"];

/// Outside of the pure modules: the only users of a path.
pub const ONLY_IN: &[(&str, &[&str])] = &[
    ("sqlx", &["storage"]),
    ("axum", &["http"]),
    ("reqwest", &["cli"]),
    ("indicatif", &["cli"]),
    // `storage` keeps the service's files; `cli` reads and writes the folders that its user names; `machine` asks the system
    ("std::fs", &["storage", "cli", "machine", "mapping"]),
    ("tokio::fs", &["storage", "cli"]),
    // where things are is between `config`, which is told, and `storage`; the service sees records
    ("std::path", &["config", "storage", "cli"]),
    ("std::process", &["cli", "main"]),
];

/// Backends of the storage: nobody names them but who opens a data folder.
pub const BACKENDS: &[&str] = &["sql", "sqlite", "postgres", "local_files", "s3"];

pub const MOST_LINES: usize = 450;

/// The crates below `crates/`, each with the room that it is; one that holds several is none itself.
pub const CRATES: &[(&str, Option<&str>)] = &[
    ("geometry", Some("geometry")),
    ("registration", Some("registration")),
    ("surface", Some("surface")),
    ("shape", None),
    ("gallery", Some("gallery")),
    ("synthetic", Some("synthetic")),
    ("formats", Some("formats")),
    ("picture", Some("picture")),
    ("report", Some("report")),
    ("domain", Some("domain")),
    ("pipeline", Some("pipeline")),
    ("service", None),
    ("http", Some("http")),
    ("mapping", Some("mapping")),
];
