// SPDX-License-Identifier: BSL-1.0
#include <cles/jobs.hpp>
#include <cles/responder.hpp>

#include "node/node_state.hpp"
#include "node/session/call.hpp"
#include "node/session/job_table.hpp"

#include <utility>

namespace cles {

void tell_job_status(const responder& job, std::function<job_status()> status) {
    const auto& call = job.node_call();
    if (call && call->job() != 0) {
        call->host()->jobs->set_status(call->job(), std::move(status));
    }
}

} // namespace cles
