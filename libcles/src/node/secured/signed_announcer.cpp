// SPDX-License-Identifier: BSL-1.0
#include "node/secured/signed_announcer.hpp"

#include <cles/json_writer.hpp>

#include "node/node_state.hpp"
#include "node/secured/own_announcement.hpp"
#include "port/node_security.hpp"

namespace cles::core {

std::string signed_announcer::announce(announcement& said, std::uint64_t& seq, bool in_group, bool by_gossip) {
    const bool has_news = by_gossip && host_.peers.has_news(said);
    const bool signs = !last_ || has_news || (in_group && !is_load_enough(said));
    if (signs) {
        said.original = sign_announcement(said, "cles", ++seq, host_.epoch, *host_.security);
        last_ = said;
    } else {
        said.original = last_->original;
    }
    must_sign_ = !signs;
    std::string line;
    if (signs) {
        append_announcement(line, host_.name, *said.original, seq, host_.epoch);
    } else {
        protocol::append_update_head(line, host_.name, load_path, seq, host_.epoch);
        json_writer w{line};
        write_load(w, said.load);
        line.push_back('\n');
    }
    return line;
}

// Not twice in a row, since nodes that have just started know nothing yet of this one.
bool signed_announcer::is_load_enough(const announcement& said) const {
    return !must_sign_ && differ_in_load_only(*last_, said);
}

bool differ_in_load_only(const announcement& one, const announcement& other) {
    return one.node == other.node && one.pool == other.pool && one.endpoints == other.endpoints &&
           one.sources == other.sources && one.interval == other.interval && one.tasks == other.tasks &&
           one.leaving == other.leaving && one.roster == other.roster && one.signed_tasks == other.signed_tasks &&
           one.load.workers == other.load.workers;
}

} // namespace cles::core
