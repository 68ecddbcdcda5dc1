// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/federation.hpp>
#include <cles/json_writer.hpp>

#include "asio/asio_environment.hpp"
#include "nats/federated_pools.hpp"
#include "node/node_state.hpp"

#include <memory>
#include <utility>

namespace cles {
namespace {

void equip(const std::shared_ptr<nats::federated_pools>& pools, asio_port::asio_environment& environment,
           core::node_options& node) {
    if (!pools->claim()) {
        throw error(errc::invalid_option, "the federation of a service cannot be used for a second one");
    }
    if (!node.pool.empty() && node.pool != pools->own_pool()) {
        throw error(errc::invalid_option, "the service belongs to the pool '" + node.pool +
                                              "', and cannot be a bridge of '" + pools->own_pool() + "'");
    }
    node.pool = pools->own_pool();
    node.pools = pools.get();
    node.metrics = [inner = std::move(node.metrics), pools](json_writer& w) {
        w.key("federation");
        pools->write_metrics(w);
        if (inner) {
            inner(w);
        }
    };
    environment.add_transport("pool", pools->make_transport());
}

} // namespace

std::function<void(asio_port::asio_environment&, core::node_options&)> federation(federation_options options) {
    return [pools = std::make_shared<nats::federated_pools>(std::move(options))](
               asio_port::asio_environment& environment, core::node_options& node) { equip(pools, environment, node); };
}

} // namespace cles
