//! The gallery searched by several servers, each a part of it, so that none has to have all of it.
//!
//! - [`membership`]: a server that searches says where it is and what it has, and sees to it that it has what falls to it
//! - [`scatter`]: a question goes to those who have the parts, and what they find is put together
//! - [`answering`]: what a server that searches answers to one that asks
//! - [`message`]: both as they go over the wire
//! - [`peers`]: the seam to the network
//!
//! A model's part follows from its id ([`Parts`](visage_domain::Parts)); who has which part is rendezvous hashing over those that have said lately
//! that they are there, two for each. A part is searched by whoever has it: its models in files, those that came since, and the marks of
//! those that are gone. So nothing is left over that somebody else would have to search, and what one server answers about a part is
//! what the whole gallery would say of it.

pub mod answering;
pub mod membership;
pub mod message;
pub mod peers;
pub mod scatter;

use std::time::Duration;

/// How often a server that searches says that it is there, and looks at what falls to it.
const BEAT: Duration = Duration::from_secs(2);
/// One that has said nothing for so long is not asked: five beats.
const SILENT: Duration = Duration::from_secs(10);
/// One that has said nothing for so long has its parts made whole by others: a restart takes less, and each move costs their processors.
const GONE: Duration = Duration::from_secs(60);
/// How long an answer is waited for, before another server that has the same parts is asked: some hundred times what a search of a million
/// models takes.
pub const PATIENCE: Duration = Duration::from_secs(15);

/// The index is not here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("this server has no index of its own, and this question needs the whole index in one server")]
pub struct Elsewhere;
