//! A server that searches says where it is and what it has, and sees to it that it has the parts that fall to it.
//!
//! What it has is said only when it has all of it, and given up only when all that it falls to have said that they have it: so while servers
//! come and go, no part is without a server that answers for it. Nobody decides for others; all look at the same table.

use super::{BEAT, GONE, SILENT};
use crate::app::context::ServiceContext;
use crate::config::Address;
use crate::storage::DatabaseError;
use visage_domain::{Parts, Searcher, placed, placed_on};

/// Parts that are made whole together: a sixteenth of the gallery, so that who comes first among many does not begin with all of it.
const AT_ONCE: usize = 16;

/// Says that this server is there, again and again. Never ends.
pub async fn announce(context: &ServiceContext, address: &Address) {
    loop {
        let known = async {
            context.database.keep_index().await?;
            tell(context, address).await
        };
        if let Err(error) = known.await {
            tracing::warn!("other servers can't be told that this one searches: {error}");
        }
        tokio::time::sleep(BEAT).await;
    }
}

/// Says that this server is not to be asked any more. It keeps its parts for a while, as it may be back soon.
pub async fn leave(context: &ServiceContext, address: &Address) {
    if let Err(error) = context.database.tell_searcher(&address.to_string(), &Parts::NONE).await {
        tracing::debug!("other servers are not told that this one leaves: {error}");
    }
}

/// Makes the parts whole that fall to this server, and gives up others. Never ends. To be called when the files of the index are mapped.
pub async fn hold(context: &ServiceContext, address: &Address) {
    loop {
        match step(context, address).await {
            Ok(true) => continue,
            Ok(false) => {}
            Err(error) => tracing::warn!("parts of the gallery that fall to this server are not there yet: {error}"),
        }
        tokio::time::sleep(BEAT).await;
    }
}

async fn tell(context: &ServiceContext, address: &Address) -> Result<(), DatabaseError> {
    context.database.tell_searcher(&address.to_string(), &context.gallery.whole_parts()).await
}

/// Makes some parts whole, or gives some up; whether there may be more to do at once.
async fn step(context: &ServiceContext, address: &Address) -> Result<bool, DatabaseError> {
    let gallery = &context.gallery;
    if !gallery.is_ready() {
        return Ok(false);
    }
    tell(context, address).await?;
    let servers = context.database.searchers(GONE).await?;
    let plan = Plan::of(context, &servers);
    if !plan.missing.is_empty() {
        let next: Parts = plan.missing.iter().take(AT_ONCE).collect();
        let is_there = gallery.acquire(&context.storage(), next).await?;
        tell(context, address).await?;
        return Ok(is_there);
    }
    if !gallery.is_settled() {
        tracing::info!(
            parts = gallery.whole_parts().len(),
            servers = servers.len(),
            "the parts of the gallery are there"
        );
        gallery.settle();
    }
    if !plan.surplus.is_empty() {
        gallery.release(&context.storage(), plan.surplus).await?;
        tell(context, address).await?;
    }
    Ok(false)
}

/// What is to be done about the parts of this server.
struct Plan {
    /// To be made whole.
    missing: Parts,
    /// To be given up.
    surplus: Parts,
}

impl Plan {
    fn of(context: &ServiceContext, servers: &[Searcher]) -> Plan {
        let me = context.database.owner().seat;
        Plan::between(me, servers, context.gallery.whole_parts(), context.gallery.present_parts())
    }

    fn between(me: visage_domain::SeatId, servers: &[Searcher], whole: Parts, present: Parts) -> Plan {
        let nodes: Vec<_> = servers.iter().map(|server| server.node).collect();
        let mine = placed_on(me, &nodes);
        let silent = u64::try_from(SILENT.as_millis()).unwrap_or(u64::MAX);
        let has = |node, part| {
            servers.iter().any(|server| server.node == node && server.silent_ms <= silent && server.parts.hold(part))
        };
        let is_elsewhere = |part: &u8| placed(*part, &nodes).iter().all(|node| has(*node, *part));
        // what is left in files of parts that are not whole is nobody's loss
        let surplus = present.without(&mine).iter().filter(|part| !whole.hold(*part) || is_elsewhere(part)).collect();
        Plan { missing: mine.without(&whole), surplus }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_domain::SeatId;

    fn server(parts: Parts, silent_ms: u64) -> Searcher {
        Searcher { node: SeatId::new(), address: "http://a.example/".to_owned(), parts, silent_ms }
    }

    #[test]
    fn who_is_alone_has_everything_and_gives_nothing_up() {
        let me = server(Parts::NONE, 0);
        let plan = Plan::between(me.node, std::slice::from_ref(&me), Parts::NONE, Parts::NONE);
        assert_eq!((plan.missing, plan.surplus), (Parts::ALL, Parts::NONE));
        let plan = Plan::between(me.node, std::slice::from_ref(&me), Parts::ALL, Parts::ALL);
        assert_eq!((plan.missing, plan.surplus), (Parts::NONE, Parts::NONE));
    }

    #[test]
    fn a_part_is_given_up_when_those_it_falls_to_have_it_and_not_before() {
        let mut servers = [server(Parts::ALL, 0), server(Parts::NONE, 0), server(Parts::NONE, 0)];
        let (me, nodes) = (servers[0].node, servers.each_ref().map(|server| server.node));
        let mine = placed_on(me, &nodes);
        assert!(mine.len() < 256);
        let plan = |servers: &[Searcher], whole| Plan::between(me, servers, whole, Parts::ALL);
        assert!(plan(&servers, Parts::ALL).surplus.is_empty(), "the others have nothing yet");
        servers[1].parts = placed_on(nodes[1], &nodes);
        assert!(plan(&servers, Parts::ALL).surplus.is_empty(), "one of two has it");
        servers[2].parts = placed_on(nodes[2], &nodes);
        assert_eq!(plan(&servers, Parts::ALL).surplus, Parts::ALL.without(&mine));
        servers[2].silent_ms = 11_000;
        assert!(plan(&servers, Parts::ALL).surplus.is_empty(), "one of them says nothing any more");
        // what files hold of other parts is not answered from
        assert_eq!(plan(&servers, mine).surplus, Parts::ALL.without(&mine));
        assert_eq!(plan(&servers, Parts::NONE).missing, mine);
    }
}
