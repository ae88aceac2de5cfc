//! Several processes on one database: who may use it, who does what alone, and what they learn of each other.

use std::sync::Arc;
use std::time::Duration;

use super::testing::PostgresPlace;
use super::{Claim, PostgresDatabase};
use crate::storage::conformance::{DatabasePlace, new_job, scan_set};
use crate::storage::database::{Alone, News, Others, Searchers, Segments, Upkeep};
use crate::storage::{Database, DatabaseError, NoReserve};
use visage_domain::{NewModel, Parts, SeatId};
use visage_shape::faces::signature::example::example;

const SOON: Duration = Duration::from_millis(1);

async fn node(place: &PostgresPlace, is_shared: bool, seat: SeatId) -> Result<PostgresDatabase, DatabaseError> {
    PostgresDatabase::open_for(place.url(), Claim { seat, is_shared }, Arc::new(NoReserve), SOON).await
}

fn model() -> NewModel {
    NewModel { signature: Some((&example(0.3, 5)).into()), ..NewModel::example(None) }
}

#[tokio::test]
#[ignore = "takes a server: .ci/postgres has one"]
async fn servers_share_a_database_if_all_of_them_do_and_each_has_a_seat() {
    let place = PostgresPlace::new().await;
    let seats = [SeatId::new(), SeatId::new()];
    let first = node(&place, true, seats[0]).await.expect("it is free");
    let second = node(&place, true, seats[1]).await.expect("it is shared");
    assert!(matches!(node(&place, true, seats[1]).await, Err(DatabaseError::SeatTaken)));
    assert!(matches!(node(&place, false, SeatId::new()).await, Err(DatabaseError::Taken)));
    for ended in [first, second] {
        ended.close().await;
    }
    // the locks go with their connections, soon
    let alone = loop {
        match node(&place, false, seats[0]).await {
            Ok(alone) => break alone,
            Err(error) => assert!(matches!(error, DatabaseError::Taken), "{error}"),
        }
    };
    assert!(matches!(node(&place, true, seats[1]).await, Err(DatabaseError::Taken)));
    alone.close().await;
}

#[tokio::test]
#[ignore = "takes a server: .ci/postgres has one"]
async fn what_is_done_alone_is_done_by_one_until_it_lets_go() {
    let place = PostgresPlace::new().await;
    let first = node(&place, true, SeatId::new()).await.expect("shared");
    let second = node(&place, true, SeatId::new()).await.expect("shared");
    let turn = first.try_alone(Alone::Upkeep).await.expect("asked").expect("it is free");
    assert!(second.try_alone(Alone::Upkeep).await.expect("asked").is_none());
    drop(turn);
    second.wait_for(Alone::Upkeep, false).await.expect("it is free again");

    let what = Alone::ConditionalChange;
    let shares =
        [first.wait_for(what, true).await.expect("shared"), second.wait_for(what, true).await.expect("shared")];
    assert!(first.try_alone(what).await.expect("asked").is_none());
    drop(shares);
    let alone = second.wait_for(what, false).await.expect("alone");
    assert!(first.try_alone(what).await.expect("asked").is_none());
    drop(alone);
    first.wait_for(what, true).await.expect("free");
}

#[tokio::test]
#[ignore = "takes a server: .ci/postgres has one"]
async fn changes_of_the_gallery_are_numbered_by_their_commits() {
    let place = PostgresPlace::new().await;
    let (here, there) = (place.open(SeatId::new()).await, place.open(SeatId::new()).await);
    let begin = there.gallery_version().await.expect("asked").expect("others may change it");
    let models = [model(), model(), model()];
    here.create_models(&models).await.expect("stored");
    let changes = there.gallery_changes(begin, 2).await.expect("asked").expect("known");
    assert_eq!((changes.models.len(), changes.version), (2, begin + 2), "a page ends at its last change");
    let rest = there.gallery_changes(changes.version, 2).await.expect("asked").expect("known");
    assert_eq!((rest.models.len(), rest.version), (1, begin + 3));
    assert!(changes.models.iter().chain(&rest.models).all(|model| model.signature.is_some()));

    drop(here.delete_model(models[0].id).await.expect("deleted"));
    let version = there.gallery_version().await.expect("asked").expect("others may change it");
    assert_eq!(version, begin + 4);
    let all = there.gallery_changes(begin, 100).await.expect("asked").expect("known");
    let told: Vec<_> = all.models.iter().map(|model| (model.id, model.signature.is_some())).collect();
    assert_eq!(
        told,
        [(models[1].id, true), (models[2].id, true), (models[0].id, false)],
        "each model once, as it is now"
    );
    // nothing is old enough to be forgotten
    there.forget_gallery_changes().await.expect("asked");
    assert!(there.gallery_changes(begin, 1).await.expect("asked").is_some());
    let far = "UPDATE gallery_change SET at = 0 WHERE version <= $1";
    let direct = node(&place, true, SeatId::new()).await.expect("shared");
    sqlx::query(far).bind(i64::try_from(version - 1).expect("small")).execute(&direct.writer).await.expect("aged");
    there.forget_gallery_changes().await.expect("asked");
    assert!(there.gallery_changes(begin, 1).await.expect("asked").is_none(), "who is so far behind has to load all");
    assert_eq!(there.gallery_changes(version - 1, 9).await.expect("asked").expect("known").models.len(), 1);
}

/// What is heard of a change, after what rings when the listening begins: soon, not when everything rings again.
async fn heard(listener: &dyn Database, change: impl Future<Output = ()>) -> News {
    let (send, mut receive) = tokio::sync::mpsc::unbounded_channel();
    let hear = |news| send.send(news).expect("somebody receives");
    let listening = listener.listen(&hear);
    let looking = async {
        for _ in 0..3 {
            receive.recv().await.expect("it listens");
        }
        change.await;
        receive.recv().await.expect("it listens")
    };
    tokio::select! {
        () = listening => unreachable!("it never ends"),
        news = looking => news,
    }
}

#[tokio::test]
#[ignore = "takes a server: .ci/postgres has one"]
async fn what_one_process_commits_rings_for_others() {
    let place = PostgresPlace::new().await;
    let (here, there) = (place.open(SeatId::new()).await, place.open(SeatId::new()).await);
    let set = scan_set(here.as_ref(), &["a.ply", "b.ply"]).await;
    let news = heard(there.as_ref(), async { drop(here.create_model(&model(), None).await.expect("stored")) }).await;
    // when everything rings, work does first
    assert_eq!(news, News::Gallery);
    let job = new_job(set);
    let queue = async { here.create_job(&job, None, 10, None).await.expect("queued") };
    assert_eq!(heard(there.as_ref(), queue).await, News::Work);
    let cancel = async {
        here.cancel_job(job.id).await.expect("canceled");
    };
    assert_eq!(heard(there.as_ref(), cancel).await, News::Work);
}

#[tokio::test]
#[ignore = "takes a server: .ci/postgres has one"]
async fn who_searches_is_known_as_it_has_said_last_and_for_a_while() {
    let place = PostgresPlace::new().await;
    let seats = [SeatId::new(), SeatId::new()];
    let first = node(&place, true, seats[0]).await.expect("shared");
    let second = node(&place, true, seats[1]).await.expect("shared");
    assert!(first.tell_searcher("http://a.example/", &Parts::ALL).await.is_err(), "it is no node yet");
    for node in [&first, &second] {
        node.keep_index().await.expect("a node");
    }
    let some: Parts = [3, 200].into_iter().collect();
    first.tell_searcher("http://a.example/", &Parts::NONE).await.expect("told");
    second.tell_searcher("http://b.example/", &Parts::ALL).await.expect("told");
    first.tell_searcher("http://c.example/", &some).await.expect("told");
    let hour = Duration::from_secs(3600);
    let mut known = second.searchers(hour).await.expect("read");
    known.sort_by_key(|searcher| searcher.node != seats[0]);
    assert_eq!((known[0].address.as_str(), known[0].parts), ("http://c.example/", some));
    assert_eq!((known[1].address.as_str(), known[1].parts, known.len()), ("http://b.example/", Parts::ALL, 2));
    assert!(known.iter().all(|searcher| searcher.silent_ms < 60_000));
    sqlx::query("UPDATE gallery_searcher SET seen_at = seen_at - 4000000 WHERE node_id = $1")
        .bind(seats[1].to_string())
        .execute(&first.writer)
        .await
        .expect("aged");
    assert_eq!(first.searchers(hour).await.expect("read").len(), 1);

    let secrets = [&first, &second].map(|node| node.node_secret());
    let [ours, theirs] = secrets;
    let (ours, theirs) = (ours.await.expect("read").expect("one"), theirs.await.expect("read").expect("one"));
    assert!(ours == theirs && ours.0.len() == 64);
    let elsewhere = node(&PostgresPlace::new().await, true, seats[0]).await.expect("shared");
    assert!(elsewhere.node_secret().await.expect("read").expect("one") != ours);
}
