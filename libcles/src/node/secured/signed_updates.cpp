// SPDX-License-Identifier: BSL-1.0
#include "node/secured/signed_updates.hpp"

#include "node/node_state.hpp"
#include "node/secured/confirmed_epochs.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <string>
#include <vector>

namespace cles::core {

std::optional<bool> must_be_signed(const node_state& n, const confirmed_epochs& confirmed, std::string_view publisher,
                                   std::string_view task) {
    if (publisher == n.name) {
        return n.tasks.is_signed(task);
    }
    const auto contains = [task](const std::vector<std::string>& tasks) {
        return std::ranges::find(tasks, task) != tasks.end();
    };
    if (const auto* const announced = n.peers.announcement_of(publisher)) {
        return contains(announced->signed_tasks);
    }
    const auto* const said = confirmed.find(publisher);
    return said != nullptr && said->signed_tasks ? std::optional{contains(*said->signed_tasks)} : std::nullopt;
}

update_check check_signature(const node_state& n, const confirmed_epochs& confirmed,
                             const protocol::request_line& update, bool direct) {
    const auto must = must_be_signed(n, confirmed, update.noun.target, update.noun.task);
    if (!must && !direct) {
        return update_check::refused;
    }
    if (!must.value_or(false) && update.sig.empty()) {
        return update_check::unsigned_one;
    }
    std::string scratch;
    const auto path = protocol::canonical_path(update.noun, scratch);
    return n.security->is_signed(member_of(n, update.noun.target), path, *update.seq,
                                 protocol::epoch_text(*update.epoch), update.body, update.sig)
               ? update_check::signed_one
               : update_check::refused;
}

} // namespace cles::core
