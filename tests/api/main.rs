//! The service over real connections, with algorithms that do what a test tells them; `binary` starts the program itself.

mod additions;
mod archives;
mod binary;
mod client_commands;
mod common;
mod conditions;
mod contract;
mod describing;
mod gallery;
mod hints;
mod hosts;
mod jobs;
mod long;
mod models;
mod page;
mod pictures;
mod pressure;
mod queries;
mod recovery;
mod renditions;
mod scan_sets;
mod slow;
mod standards;
mod storage;
mod surfaces;
