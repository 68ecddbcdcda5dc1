// SPDX-License-Identifier: BSL-1.0
#include "node/secured/signed_updates.hpp"

#include "node/node_state.hpp"
#include "port/node_security.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <string>

namespace cles::core {

std::optional<bool> must_be_signed(const node_state& n, std::string_view publisher, std::string_view task) {
    if (publisher == n.name) {
        return n.tasks.is_signed(task);
    }
    const auto* const said = n.peers.announcement_of(publisher);
    if (said == nullptr) {
        return {};
    }
    return std::ranges::find(said->signed_tasks, task) != said->signed_tasks.end();
}

update_check check_signature(const node_state& n, const protocol::request_line& update, bool direct) {
    const auto must = must_be_signed(n, update.noun.target, update.noun.task);
    if (!must && !direct) {
        return update_check::refused;
    }
    if (!must.value_or(false) && update.sig.empty()) {
        return update_check::unsigned_one;
    }
    std::string scratch;
    const auto path = protocol::canonical_path(update.noun, scratch);
    return n.security->is_signed(update.noun.target, path, *update.seq, protocol::epoch_text(*update.epoch),
                                 update.body, update.sig)
               ? update_check::signed_one
               : update_check::refused;
}

} // namespace cles::core
