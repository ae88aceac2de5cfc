//! The service over real connections, with algorithms that do what a test tells them; `binary` starts the program itself.

mod additions;
mod binary;
mod common;
mod contract;
mod gallery;
mod jobs;
mod long;
mod models;
mod queries;
mod recovery;
mod scan_sets;
mod standards;
mod storage;
