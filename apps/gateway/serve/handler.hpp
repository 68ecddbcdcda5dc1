// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "gateway/access/admission.hpp"
#include "gateway/access/origin.hpp"
#include "gateway/serve/exchange.hpp"
#include "gateway/serve/exchanges.hpp"
#include "gateway/serve/span_exporter.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace gateway {

/// How requests are served.
struct handler_settings {
    origin_rules origins{};
    bool is_secured = false; ///< the node is a member of a fleet, and callers are too
};

/// Decides which requests are served, and begins them.
class handler final : public request_handler {
  public:
    /// \param spans null: none are exported
    handler(cles::service& node, handler_settings settings, admission& door, gateway_counts& counts,
            std::shared_ptr<span_exporter> spans, std::function<void(const std::string&)> log)
        : node_(node), settings_(std::move(settings)), door_(door), counts_(counts), spans_(std::move(spans)),
          log_(std::move(log)) {}

    std::optional<http_response> response_to_head(const http_request& head) override;
    std::shared_ptr<exchange> begin(const http_request& request, const std::shared_ptr<response_sink>& to) override;

  private:
    /// What is asked for, or why it is not served.
    std::variant<asked, refusal> decide(const http_request& head);
    refusal denied(refusal why);
    [[nodiscard]] http_response refused(const refusal& why, const http_request& head) const;
    http_response session_response(const http_request& request, const asked& what);
    std::shared_ptr<exchange> begin_in_fleet(const http_request& request, const std::shared_ptr<response_sink>& to,
                                             asked what);

    cles::service& node_;
    handler_settings settings_;
    admission& door_;
    gateway_counts& counts_;
    std::shared_ptr<span_exporter> spans_;
    std::function<void(const std::string&)> log_;
    type_cache types_;
    time_point logged_{};
};

} // namespace gateway
