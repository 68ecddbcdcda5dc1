// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "gateway/access/admission.hpp"
#include "gateway/http/route.hpp"
#include "gateway/serve/exchange.hpp"
#include "gateway/told/metrics.hpp"

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace gateway {

/// A request that may be served: what it asks for, for whom, and how it is responded to.
struct asked {
    route where{};
    caller who{};
    header_fields fields{};              ///< that every response to it has
    std::function<bool()> is_admitted{}; ///< whether the caller may still use the gateway
    bool is_secured = false;             ///< the caller is a member of the fleet, whose rights count

    /// States on whose behalf a request is sent. \param options those of a request or of a binding
    template <class Options>
    void state_member(Options& options) const {
        if (is_secured) {
            options.on_behalf_of(who.name); // an empty name is refused
        }
    }
};

/// What nodes have told about types, as long as their digest is the same: by who has asked, node, digest and task. (Two
/// nodes may state the same digest, and one of them lie.)
class type_cache {
  public:
    /// Null if it is not known.
    [[nodiscard]] const std::string* find(const std::string& key) const;
    /// If there is no room, what is known is forgotten.
    void keep(const std::string& key, const std::string& told);

  private:
    std::map<std::string, std::string> told_;
    std::size_t bytes_ = 0;
};

/// A PULL, PUSH, DELEGATE or UPDATE for a client.
/// \param wants_events the response is a stream of `progress`, and at last `result` or `failure`
/// \param ended called with the outcome: "ok", or the code of the failure
std::shared_ptr<exchange> begin_request(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        const cles::call_options& options, std::string_view body, bool wants_events,
                                        std::function<void(std::string_view outcome)> ended);

/// A BIND for a client: a stream of server-sent events. Updates wait in the feed until the client takes them; the feed
/// drops the oldest, and counts them. While its publisher is not there, the gateway tries again. \param last_event_id
/// what the client has received
std::shared_ptr<exchange> begin_binding(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        std::chrono::milliseconds deadline, std::string_view last_event_id,
                                        gateway_counts& counts);

/// /metrics: those of all nodes that answer.
std::shared_ptr<exchange> begin_metrics(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        metrics_format format);

/// /openapi.json: what all nodes offer that answer, with the types that they tell in time.
std::shared_ptr<exchange> begin_openapi(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        type_cache& known);

} // namespace gateway
