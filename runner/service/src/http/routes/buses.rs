//! Buses, and the units on them.

use axum::Json;
use axum::extract::State;

use super::super::problem::Refused;
use super::{Answer, At};
use crate::Gateway;
use crate::view::BusView;

/// All buses with their units
///
/// What each is planned to carry beside what was measured; of each unit's link the buffer, what its
/// machine takes, and the two slots for plug-ins.
#[utoipa::path(get, operation_id = "bus_list", path = "/buses",
    tag = "buses",
    responses((status = OK, body = Vec<BusView>), Refused))]
pub(super) async fn list(State(app): At) -> Answer<Json<Vec<BusView>>> {
    app.ask(Gateway::buses).await.map(Json)
}
