// SPDX-License-Identifier: BSL-1.0
#include "core/reserved_tasks.hpp"

#include <string>

namespace cles::core {

void serve_reserved(node& host, reply_writer& replies, const protocol::request_line& r) {
    const auto& parameters = r.noun.parameters;
    if (r.verb == verb::pull && parameters.empty()) {
        replies.write(r, [&](json_writer& w) { write_description(w, host); });
    } else if (r.verb == verb::pull && parameters.size() == 1 && parameters[0] == "metrics") {
        replies.write(r, [&](json_writer& w) { write_metrics(w, host); });
    } else if (r.verb == verb::pull && parameters.size() == 1 && parameters[0] == "peers") {
        replies.write(r, [&](json_writer& w) { write_peers(w, host.others, host.time.now()); });
    } else if (r.verb == verb::push && parameters.size() == 2 && parameters[0] == "cancel") {
        replies.fail(r, errc::bad_request, host.name + ": cancel needs an id from 1 to 2^63-1");
    } else {
        replies.fail(r, errc::no_task,
                     host.name + " has no " + std::string{to_string(r.verb)} + " '" + std::string{r.noun.path} + "'");
    }
}

} // namespace cles::core
