// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/node_hosts.hpp"

namespace cles::simulation {

node_run* node_hosts::node(unsigned host) const noexcept {
    const auto found = nodes_.find(host);
    return found == nodes_.end() ? nullptr : found->second.get();
}

node_run* node_hosts::active(unsigned host) const noexcept {
    auto* n = node(host);
    return n == nullptr || n->frozen() ? nullptr : n;
}

std::vector<node_run*> node_hosts::running() const {
    std::vector<node_run*> all;
    for (const auto& [host, n] : nodes_) {
        if (n) {
            all.push_back(n.get());
        }
    }
    return all;
}

void node_hosts::end_all() {
    time_.clear();
    for (auto& [host, n] : nodes_) {
        if (n) {
            end_run(*n);
            n.reset();
        }
    }
}

void node_hosts::end_node(unsigned host, std::chrono::milliseconds down) {
    if (node(host) == nullptr) {
        return;
    }
    const auto gone = nodes_[host];
    end_run(*gone);
    nodes_[host].reset();
    time_.later(down, [this, host] {
        if (node(host) == nullptr) {
            start(host);
        }
    });
}

void node_hosts::freeze(unsigned host, std::chrono::milliseconds span) {
    if (auto* n = node(host)) {
        watcher_.saw(n->name(), "is stopped");
        n->freeze_for(span);
    }
}

void node_hosts::jump(unsigned host, std::chrono::milliseconds ahead) {
    if (auto* n = node(host)) {
        watcher_.saw(n->name(), "has its clock set");
        n->jump(ahead);
    }
}

void node_hosts::end_trouble() {
    net_.calm();
    for (const auto& [host, n] : nodes_) {
        if (n == nullptr) {
            start(host);
        }
        n->thaw();
    }
}

} // namespace cles::simulation
