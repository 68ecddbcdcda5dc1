// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>
#include <cles/sharing.hpp>

#include "api/engine.hpp"
#include "node/sharing/work_sharing.hpp"

#include <memory>

namespace cles {

struct detail::sharing_access {
    static core::local_node& node_of(service& s) noexcept { return *s.engine_; }
};

std::unique_ptr<job_sharing> share_jobs(service& by, shareable_queue& jobs) {
    return core::make_sharing(detail::sharing_access::node_of(by), jobs);
}

} // namespace cles
