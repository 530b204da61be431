//! Links: what they do, and bringing them back to work.

use std::time::Duration;

use axum::Json;
use axum::extract::State;

use super::super::access::Admin;
use super::super::extract::{Document, Segments};
use super::super::limits::GATHER;
use super::super::problem::Refused;
use super::super::stream::{self, Polled, Stream, Telling};
use super::{Answer, At};
use crate::Gateway;
use crate::gateway::Next;
use crate::view::{HistoryView, KindView, LatheView, LinkView, Seen, SwapOrder, SwapView};

/// All links, in the order of their names
#[utoipa::path(get, operation_id = "link_list", path = "/links",
    tag = "links",
    responses((status = OK, body = Vec<LinkView>), Refused))]
pub(super) async fn list(State(app): At) -> Answer<Json<Vec<LinkView>>> {
    app.ask(Gateway::links).await.map(Json)
}

/// One link
#[utoipa::path(get, operation_id = "link_show", path = "/links/{link}",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = LinkView), Refused))]
pub(super) async fn show(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<LinkView>> {
    app.ask(move |gateway| gateway.link(&link)).await.map(Json)
}

/// The kinds of job that a link's plug-in takes
#[utoipa::path(get, operation_id = "link_kinds", path = "/links/{link}/kinds",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = Vec<KindView>), Refused))]
pub(super) async fn kinds(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<Vec<KindView>>> {
    app.ask(move |gateway| gateway.job_kinds(&link)).await.map(Json)
}

/// What the simulated lathe of a link has cut
///
/// Of links whose port is `simulate:pulse-lathe`.
#[utoipa::path(get, operation_id = "link_lathe", path = "/links/{link}/lathe",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = LatheView), Refused))]
pub(super) async fn lathe(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<LatheView>> {
    app.look(move |gateway| gateway.lathe(&link)).await.map(Json)
}

/// What a link did over the last day
///
/// The last ten minutes by the second and the last day by the minute, since the gateway started.
#[utoipa::path(get, operation_id = "link_history", path = "/links/{link}/history",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = HistoryView), Refused))]
pub(super) async fn history(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<HistoryView>> {
    app.look(move |gateway| gateway.history(&link)).await.map(Json)
}

/// Close a link's port and open it again
#[utoipa::path(post, operation_id = "link_reopen", path = "/links/{link}/reopen",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = LinkView), Refused))]
pub(super) async fn reopen(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<LinkView>> {
    app.ask(move |gateway| gateway.reopen(&link)).await.map(Json)
}

/// Go on although the machine holds the line
#[utoipa::path(post, operation_id = "link_force_resume", path = "/links/{link}/force-resume",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = LinkView), Refused))]
pub(super) async fn force_resume(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<LinkView>> {
    app.ask(move |gateway| gateway.force_resume(&link)).await.map(Json)
}

/// Stop a link's plug-in at once, whatever it is doing
///
/// The link is in quarantine then: its port stays open, nothing is read or sent. An admin's.
#[utoipa::path(post, operation_id = "link_quarantine", path = "/links/{link}/quarantine",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = LinkView), Refused))]
pub(super) async fn quarantine(
    _: Admin,
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<LinkView>> {
    app.ask(move |gateway| gateway.quarantine(&link)).await.map(Json)
}

/// Let a link out of quarantine
#[utoipa::path(post, operation_id = "link_release", path = "/links/{link}/release",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = LinkView), Refused))]
pub(super) async fn release(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<LinkView>> {
    app.ask(move |gateway| gateway.release(&link)).await.map(Json)
}

/// Swap a link's plug-in
///
/// Goes on with the same port, in the middle of a job where the plug-ins' states fit. An admin's.
#[utoipa::path(post, operation_id = "link_swap", path = "/links/{link}/swap",
    tag = "plug-ins",
    params(("link" = String, Path, description = "Name of the link")),
    request_body = SwapOrder,
    responses((status = OK, body = SwapView), Refused))]
pub(super) async fn swap(
    _: Admin,
    State(app): At,
    Segments(link): Segments<String>,
    Document(order): Document<SwapOrder>,
) -> Answer<Json<SwapView>> {
    app.ask(move |gateway| gateway.swap(&link, &order)).await.map(Json)
}

/// Watch what passes on a link's line
///
/// Server-sent events: `seen` with a list of what was seen. The link never waits for its watchers;
/// what they are too slow for is counted.
#[utoipa::path(get, operation_id = "link_watch", path = "/links/{link}/watch",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = Vec<Seen>, content_type = "text/event-stream"), Refused))]
pub(super) async fn watch(State(app): At, Segments(link): Segments<String>) -> Answer<Stream> {
    let slot = app.stream_slot()?;
    let mut watching = app.ask(move |gateway| gateway.watch(&link)).await?;
    let source = move || match watching.next(Duration::ZERO) {
        Next::Seen(seen) => Polled::News(seen),
        Next::Nothing => Polled::Nothing,
        Next::End => Polled::End,
    };
    let telling =
        Telling { name: "seen", gather: GATHER, apart: GATHER, thin: |seen: Vec<Seen>| seen };
    Ok(stream::of(source, telling, app.stopping.clone(), slot))
}
