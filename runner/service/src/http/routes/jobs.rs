//! Jobs: the queue, and feeding one from the request itself.

use softplug_abi::JobId;
use std::collections::BTreeMap;

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};

use super::super::extract::{Document, Filter, Segments};
use super::super::limits::FEED_PACE;
use super::super::problem::{Problem, Refused};
use super::super::upload;
use super::{Answer, At, within_limit};
use crate::Refusal;
use crate::jobs::BeginAt;
use crate::view::{CheckView, JobFilter, JobOrder, JobView};

/// Put a job into a link's queue
///
/// The program is copied first: editing it afterwards changes nothing.
#[utoipa::path(post, operation_id = "job_submit", path = "/links/{link}/jobs",
    tag = "jobs",
    params(("link" = String, Path, description = "Name of the link")),
    request_body = JobOrder,
    responses((status = CREATED, body = JobView), Refused))]
pub(super) async fn submit(
    State(app): At,
    Segments(link): Segments<String>,
    Document(order): Document<JobOrder>,
) -> Answer<(StatusCode, Json<JobView>)> {
    let job = app.ask(move |gateway| gateway.submit(&link, &order)).await?;
    Ok((StatusCode::CREATED, Json(job)))
}

/// What is checked.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct CheckOrder {
    /// Name of the program.
    program: String,
    /// The kind of job that would send it, as the plug-in's manifest names it; `send` if nothing is
    /// said.
    kind: Option<String>,
    /// Fields of the job: a JSON object of texts.
    fields: Option<String>,
}

/// What a program cannot say on a link's line
///
/// Each of its characters is tried through the link's plug-in, with its settings and on its line:
/// whether it passes, is left out, replaced or refused; then the program as a whole. Nothing is
/// sent, and neither the link nor its machine notices.
#[utoipa::path(get, operation_id = "link_check", path = "/links/{link}/check",
    tag = "links",
    params(("link" = String, Path, description = "Name of the link"), CheckOrder),
    responses((status = OK, body = CheckView), Refused))]
pub(super) async fn check(
    State(app): At,
    Segments(link): Segments<String>,
    Filter(CheckOrder { program, kind, fields }): Filter<CheckOrder>,
) -> Answer<Json<CheckView>> {
    let order = FeedOrder { program: Some(program), kind, fields }.read()?;
    app.compute(move |gateway, stop| gateway.check(&link, &order, stop)).await.map(Json)
}

/// A job whose data is the request's body.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields, default)]
#[into_params(parameter_in = Query)]
pub(super) struct FeedOrder {
    /// The kind, as the plug-in's manifest names it; `send` if nothing is said.
    kind: Option<String>,
    /// What the program is called.
    program: Option<String>,
    /// Fields of the job: a JSON object of texts.
    fields: Option<String>,
}

/// Send the request's body to the machine as it comes
///
/// The body is taken as fast as the machine takes it, and is not stored. The link must be free. The
/// answer comes when all of the body was taken. For a plug-in that looks at a program before it
/// sends it, the body is kept first and waits in the link's queue then.
#[utoipa::path(post, operation_id = "job_feed", path = "/links/{link}/feed",
    tag = "jobs",
    params(("link" = String, Path, description = "Name of the link"), FeedOrder),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = CREATED, body = JobView), Refused))]
pub(super) async fn feed(
    State(app): At,
    Segments(link): Segments<String>,
    Filter(order): Filter<FeedOrder>,
    headers: HeaderMap,
    body: Body,
) -> Answer<(StatusCode, Json<JobView>)> {
    let _slot = app.feed_slot()?;
    let order = order.read()?;
    let length = headers.get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok());
    let length = length.and_then(|length| length.parse().ok());
    let gateway = app.gateway.clone();
    let job = upload::receive(body, FEED_PACE, u64::MAX, move |body| {
        Ok(gateway.feed(&link, &order, length, body)?)
    });
    Ok((StatusCode::CREATED, Json(job.await?)))
}

impl FeedOrder {
    fn read(self) -> Answer<JobOrder> {
        let fields = match self.fields.as_deref() {
            None => BTreeMap::new(),
            Some(text) => serde_json::from_str(text).map_err(|error| {
                Problem::bad(format!("fields must be a JSON object of texts: {error}"))
                    .of_field("fields")
            })?,
        };
        Ok(JobOrder { kind: self.kind, program: self.program, fields, ..JobOrder::default() })
    }
}

/// Jobs, the newest first
#[utoipa::path(get, operation_id = "job_list", path = "/jobs",
    tag = "jobs", params(JobFilter),
    responses((status = OK, body = Vec<JobView>), Refused))]
pub(super) async fn list(
    State(app): At,
    Filter(filter): Filter<JobFilter>,
) -> Answer<Json<Vec<JobView>>> {
    within_limit(filter.limit)?;
    app.look(move |gateway| gateway.jobs(&filter)).await.map(Json)
}

/// One job
#[utoipa::path(get, operation_id = "job_show", path = "/jobs/{id}",
    tag = "jobs",
    params(("id" = u32, Path, description = "Number of the job")),
    responses((status = OK, body = JobView), Refused))]
pub(super) async fn show(State(app): At, Segments(id): Segments<u32>) -> Answer<Json<JobView>> {
    app.ask(move |gateway| gateway.job(JobId(id))).await.map(Json)
}

/// Pause a job
#[utoipa::path(post, operation_id = "job_pause", path = "/jobs/{id}/pause",
    tag = "jobs",
    params(("id" = u32, Path, description = "Number of the job")),
    responses((status = OK, body = JobView), Refused))]
pub(super) async fn pause(State(app): At, Segments(id): Segments<u32>) -> Answer<Json<JobView>> {
    app.ask(move |gateway| gateway.pause(JobId(id))).await.map(Json)
}

/// End a job's pause
#[utoipa::path(post, operation_id = "job_resume", path = "/jobs/{id}/resume",
    tag = "jobs",
    params(("id" = u32, Path, description = "Number of the job")),
    responses((status = OK, body = JobView), Refused))]
pub(super) async fn resume(State(app): At, Segments(id): Segments<u32>) -> Answer<Json<JobView>> {
    app.ask(move |gateway| gateway.resume(JobId(id))).await.map(Json)
}

/// Abort a job, or take it out of the queue
#[utoipa::path(post, operation_id = "job_abort", path = "/jobs/{id}/abort",
    tag = "jobs",
    params(("id" = u32, Path, description = "Number of the job")),
    responses((status = OK, body = JobView), Refused))]
pub(super) async fn abort(State(app): At, Segments(id): Segments<u32>) -> Answer<Json<JobView>> {
    app.ask(move |gateway| gateway.abort(JobId(id))).await.map(Json)
}

/// Where a job that has ended begins again: at a block, at a byte, or at the program's beginning.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RestartOrder {
    /// The block, counted from 1.
    #[serde(default)]
    from_block: Option<u64>,
    /// So many bytes of the program are left out.
    #[serde(default)]
    from_byte: Option<u64>,
}

impl RestartOrder {
    fn at(&self) -> Result<BeginAt, Refusal> {
        match (self.from_block, self.from_byte) {
            (None, None) => Ok(BeginAt::Start),
            (Some(block), None) => Ok(BeginAt::Block(block)),
            (None, Some(byte)) => Ok(BeginAt::Byte(byte)),
            (Some(_), Some(_)) => {
                let text = "a job begins at a block or at a byte: give one of the two";
                Err(Refusal::invalid("from_byte", text))
            }
        }
    }
}

/// Put a job that has ended into the queue again, as a new job
#[utoipa::path(post, operation_id = "job_restart", path = "/jobs/{id}/restart",
    tag = "jobs",
    params(("id" = u32, Path, description = "Number of the job")),
    request_body = RestartOrder,
    responses((status = CREATED, body = JobView), Refused))]
pub(super) async fn restart(
    State(app): At,
    Segments(id): Segments<u32>,
    Document(order): Document<RestartOrder>,
) -> Answer<(StatusCode, Json<JobView>)> {
    let job = app.ask(move |gateway| gateway.restart(JobId(id), order.at()?)).await?;
    Ok((StatusCode::CREATED, Json(job)))
}

/// Acknowledge how a job ended
///
/// It, and those of its link before it, no longer count as trouble.
#[utoipa::path(post, operation_id = "job_acknowledge", path = "/jobs/{id}/acknowledge",
    tag = "jobs",
    params(("id" = u32, Path, description = "Number of the job")),
    responses((status = OK, body = JobView), Refused))]
pub(super) async fn acknowledge(
    State(app): At,
    Segments(id): Segments<u32>,
) -> Answer<Json<JobView>> {
    app.ask(move |gateway| gateway.acknowledge(JobId(id))).await.map(Json)
}

/// Another priority for a job that waits.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PriorityOrder {
    /// Jobs of a higher priority come first.
    priority: i32,
}

/// Give a job that waits another priority
#[utoipa::path(put, operation_id = "job_prioritise", path = "/jobs/{id}/priority",
    tag = "jobs",
    params(("id" = u32, Path, description = "Number of the job")),
    request_body = PriorityOrder,
    responses((status = OK, body = JobView), Refused))]
pub(super) async fn prioritise(
    State(app): At,
    Segments(id): Segments<u32>,
    Document(order): Document<PriorityOrder>,
) -> Answer<Json<JobView>> {
    app.ask(move |gateway| gateway.prioritise(JobId(id), order.priority)).await.map(Json)
}
