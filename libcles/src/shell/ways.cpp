// SPDX-License-Identifier: BSL-1.0
#include "shell/ways.hpp"

#include "shell/local_node.hpp"
#include "shell/upstream_feed.hpp"

#include <string>
#include <utility>

namespace cles::shell {

std::uint64_t ways::send(const request& r, detail::pending_ptr reply, core::outbound::progress_function progress) {
    boost::system::error_code code;
    std::string why;
    auto* way = host_.stopped() ? nullptr : host_.routes().to(r.node, {}, r.urgent, code, why);
    if (way == nullptr) {
        if (host_.stopped()) {
            code = errc::stopped;
        }
        host_.fail_later(std::move(reply), code, std::move(why));
        return 0;
    }
    std::string noun;
    noun.reserve(r.node.size() + 1 + r.path.size());
    noun.append(r.node).append(":").append(r.path);
    const auto id = host_.draw_id();
    way->send({.verb = r.verb,
               .noun = noun,
               .adverbs = r.adverbs,
               .body = r.body,
               .id = id,
               .urgent = r.urgent,
               .begun = host_.now(),
               .deadline = r.deadline},
              std::move(reply), std::move(progress));
    host_.settle();
    return id;
}

ways::~ways() = default;

void ways::stop() {
    for (const auto& [ticket, feed] : std::exchange(feeds_, {})) {
        feed->close();
    }
}

std::uint64_t ways::bind(std::string_view node, std::string_view path, std::string_view adverbs,
                         core::feed_events& to) {
    const auto ticket = host_.draw_id();
    const auto made = std::make_shared<upstream_feed>(host_.shared_from_this(), std::string{node}, std::string{path},
                                                      to, [this, ticket] { feeds_.erase(ticket); });
    feeds_.emplace(ticket, made);
    made->begin(adverbs);
    return ticket;
}

void ways::unbind(std::uint64_t ticket) {
    if (const auto held = feeds_.extract(ticket); !held.empty()) {
        held.mapped()->close();
    }
}

void ways::withdraw(std::uint64_t ticket) { host_.cancel(ticket); }

} // namespace cles::shell
