// SPDX-License-Identifier: BSL-1.0
#include "daemon/service_setup.hpp"

#include <cles/jobs.hpp>
#include <cles/tracing.hpp>
#include <cles/types.hpp>

#include "config/config.hpp"
#include "daemon/service_parts.hpp"

#include <utility>

namespace cles::runtime {

service_options options_of(const config& setup, log_sink log) {
    service_options options{.name = setup.node};
    options.pool = setup.pool;
    options.listen = setup.listen;
    options.peers = setup.peers;
    options.insecure = setup.insecure;
    options.security = security_of(setup);
    options.federation = federation_of(setup);
    options.networks = setup.networks;
    options.multicast = setup.multicast;
    options.limits = setup.limits;
    options.log = std::move(log);
    options.routing = cles::routing();
    options.tracing = cles::tracing();
    options.types = cles::types();
    options.jobs = cles::jobs();
    options.gossip = cles::gossip(setup.seeds, setup.links); // without any, this node may be the seed of others
    return options;
}

} // namespace cles::runtime
