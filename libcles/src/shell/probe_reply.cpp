// SPDX-License-Identifier: BSL-1.0
#include "shell/probe_reply.hpp"

#include <cles/error.hpp>

#include "shell/local_node.hpp"

#include <boost/system/errc.hpp>

#include <utility>

namespace cles::shell {
namespace {

using outcome = core::probe_outcome::kind;

// What says that nobody is there; not what this node lacks, nor that somebody is busy.
outcome outcome_of(boost::system::error_code code) {
    namespace system_errc = boost::system::errc;
    const bool absent = code == errc::deadline || code == errc::unavailable ||
                        code == system_errc::connection_refused || code == system_errc::connection_reset ||
                        code == system_errc::timed_out || code == system_errc::no_such_file_or_directory;
    return absent ? outcome::absent : outcome::unclear;
}

} // namespace

probe_reply::verdict probe_reply::offer(std::string_view json) {
    if (!is_valid_json(json)) {
        return verdict::malformed;
    }
    const std::unique_ptr<probe_reply> self{this};
    tell(core::read_probe_answer(json));
    return verdict::completed;
}

void probe_reply::fail(boost::system::error_code code, std::string_view) {
    const std::unique_ptr<probe_reply> self{this};
    tell({.what = outcome_of(code)});
}

void probe_reply::refuse(boost::system::error_code, std::string_view, std::string_view) {
    const std::unique_ptr<probe_reply> self{this};
    tell({});
}

void probe_reply::tell(core::probe_outcome found) const {
    const auto host = host_.lock();
    if (!host || host->stopped()) {
        return;
    }
    // The link by which it has come may be let go of, and others told, when that is through with it.
    core::post(host->environment(), [weak = host_, ticket = ticket_, url = url_, found = std::move(found)] {
        if (const auto alive = weak.lock(); alive && !alive->stopped()) {
            alive->node().others.on_probed(ticket, found, alive->now());
            alive->routes().release(url);
            alive->settle();
        }
    });
}

} // namespace cles::shell
