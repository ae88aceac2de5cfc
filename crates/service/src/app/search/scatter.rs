//! A question goes to those who have the parts of the gallery, and what they find is put together.
//!
//! Every part is asked of one server: the first of those that fall to it by rendezvous that has it. Who gives no answer, or has a part no
//! longer, is not asked for that again in this query, and the next one that has it is. How good the best is that others have found is not passed on: all are asked
//! at the same time, and a search of a part is cheap beside waiting for another one.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use futures_util::future::join_all;

use super::SILENT;
use super::message::{Asked, Found};
use crate::app::context::ServiceContext;
use crate::app::queries::{QueryError, Question};
use crate::app::webhooks::Unreached;
use visage_domain::{NodeSecret, Part, Parts, Searcher, SeatId, weight};
use visage_gallery::{Match, gathered};

/// What all servers together have found.
#[derive(Debug, Clone)]
pub struct Gathered {
    /// What is asked for of the ranking, and one more.
    pub matches: Vec<Match>,
    /// How many models were searched.
    pub searched: usize,
    /// The parts that nobody who answers has.
    pub missing: Parts,
}

/// Asks those who have the parts, from the gallery as it is at this moment or later.
pub async fn ask(context: &ServiceContext, question: &Question) -> Result<Gathered, QueryError> {
    let Some(version) = context.database.gallery_version().await? else { return Ok(nothing()) };
    let Some(secret) = context.node_secret().await? else { return Ok(nothing()) };
    let mut round = Round { left: Parts::ALL, refused: BTreeMap::new() };
    let (mut rankings, mut searched) = (Vec::new(), 0);
    while !round.left.is_empty() {
        // those who have come, or have got parts, since the last look are asked, too
        let servers = context.database.searchers(SILENT).await?;
        let plan = round.plan(&servers);
        if plan.is_empty() {
            break;
        }
        let secret = &secret;
        let asks = plan.iter().map(|(server, parts)| async move {
            let asked = Asked { node: server.node, version, parts: *parts, question: question.clone() };
            (server, *parts, one(context, server, secret, &asked).await)
        });
        for (server, parts, answer) in join_all(asks).await {
            match answer {
                Ok(found) => {
                    round.answered(server.node, parts, found.parts);
                    searched += found.searched;
                    rankings.push(found.matches);
                }
                Err(error) => {
                    tracing::warn!(node = %server.node, address = server.address, "a server does not search: {error}");
                    round.refused(server.node, Parts::ALL);
                }
            }
        }
    }
    Ok(Gathered { matches: gathered(rankings, question.limit + 1), searched, missing: round.left })
}

fn nothing() -> Gathered {
    Gathered { matches: Vec::new(), searched: 0, missing: Parts::ALL }
}

async fn one(
    context: &ServiceContext,
    server: &Searcher,
    secret: &NodeSecret,
    asked: &Asked,
) -> Result<Found, Unreached> {
    let failed = |error: &dyn std::fmt::Display| Unreached::Failed(error.to_string());
    let address = server.address.parse().map_err(|error| failed(&error as &crate::config::NoAddress))?;
    let message = asked.encode().ok_or_else(|| Unreached::Failed("this is not asked of others".to_owned()))?;
    let answer = context.peers.ask(&address, secret, message).await?;
    let found = Found::decode(&answer).map_err(|error| failed(&error))?;
    // whatever was not asked for may be in another answer, too
    if !found.parts.without(&asked.parts).is_empty() {
        return Err(Unreached::Failed("it answered for parts that it was not asked about".to_owned()));
    }
    Ok(found)
}

/// Which parts are still to be searched, and by whom they won't be.
struct Round {
    left: Parts,
    refused: BTreeMap<SeatId, Parts>,
}

impl Round {
    /// Who is asked for what. Empty when nobody is left who has any of what is missing.
    fn plan<'a>(&self, servers: &'a [Searcher]) -> Vec<(&'a Searcher, Parts)> {
        let mut plan: Vec<(&Searcher, Parts)> = servers.iter().map(|server| (server, Parts::NONE)).collect();
        for part in self.left.iter() {
            let has = |(server, _): &&mut (&Searcher, Parts)| self.may_have(server, part);
            let first =
                plan.iter_mut().filter(has).min_by_key(|(server, _)| (Reverse(weight(part, server.node)), server.node));
            if let Some((_, parts)) = first {
                parts.insert(part);
            }
        }
        plan.retain(|(_, parts)| !parts.is_empty());
        plan
    }

    fn may_have(&self, server: &Searcher, part: Part) -> bool {
        server.parts.hold(part) && !self.refused.get(&server.node).is_some_and(|refused| refused.hold(part))
    }

    fn answered(&mut self, server: SeatId, asked: Parts, answered: Parts) {
        self.left = self.left.without(&answered);
        self.refused(server, asked.without(&answered));
    }

    fn refused(&mut self, server: SeatId, parts: Parts) {
        let refused = self.refused.entry(server).or_default();
        *refused = refused.and(&parts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_domain::{placed, placed_on};

    fn servers(count: usize) -> Vec<Searcher> {
        let nodes: Vec<SeatId> = (0..count).map(|_| SeatId::new()).collect();
        let server = |node: &SeatId| Searcher {
            node: *node,
            address: "http://a.example/".to_owned(),
            parts: placed_on(*node, &nodes),
            silent_ms: 0,
        };
        nodes.iter().map(server).collect()
    }

    fn begun() -> Round {
        Round { left: Parts::ALL, refused: BTreeMap::new() }
    }

    #[test]
    fn every_part_is_asked_of_one_server_its_first_and_then_its_second() {
        let servers = servers(5);
        let nodes: Vec<SeatId> = servers.iter().map(|server| server.node).collect();
        let mut round = begun();
        let first = round.plan(&servers);
        assert_eq!(first.iter().map(|(_, parts)| parts.len()).sum::<usize>(), 256);
        for (server, parts) in &first {
            assert!(parts.iter().all(|part| placed(part, &nodes)[0] == server.node));
        }
        // one answers nothing, the others all
        let gone = first[2].0.node;
        for (server, parts) in &first {
            match server.node == gone {
                true => round.refused(gone, Parts::ALL),
                false => round.answered(server.node, *parts, *parts),
            }
        }
        assert_eq!(round.left, first[2].1);
        let second = round.plan(&servers);
        assert_eq!(second.iter().map(|(_, parts)| parts.len()).sum::<usize>(), round.left.len());
        for (server, parts) in &second {
            assert!(parts.iter().all(|part| placed(part, &nodes)[1] == server.node));
        }
        // what nobody has is left, and nobody is asked for ever
        for server in &servers {
            round.refused(server.node, Parts::ALL);
        }
        assert!(round.plan(&servers).is_empty() && !round.left.is_empty());
    }

    #[test]
    fn who_has_lost_a_part_is_asked_for_the_others_alone() {
        let servers = servers(2);
        let mut round = begun();
        let lost: Parts = (0..40).collect();
        for (server, parts) in round.plan(&servers) {
            round.answered(server.node, parts, parts.without(&lost));
        }
        assert_eq!(round.left, lost);
        let mut again = round.plan(&servers);
        assert_eq!(again.iter().map(|(_, parts)| parts.len()).sum::<usize>(), lost.len(), "the other one is");
        let (server, parts) = again.remove(0);
        round.answered(server.node, parts, Parts::NONE);
        assert!(round.plan(&servers).iter().all(|(other, _)| other.node != server.node));
    }

    #[test]
    fn without_servers_nobody_is_asked() {
        assert!(begun().plan(&[]).is_empty());
    }
}
