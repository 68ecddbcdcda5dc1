// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>
#include <cles/url.hpp>

#include "gateway/serve/exchange.hpp"
#include "gateway/told/spans.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace gateway {

/// Where a collector of OpenTelemetry takes spans, by OTLP/HTTP.
struct collector_address {
    cles::url at;
    std::string path;
};
/// Reads "http://127.0.0.1:4318"; without a path, it is /v1/traces.
/// \throws std::runtime_error or cles::error, which say what is wrong
collector_address collector_at(const std::string& url);

/// Sends the spans of the requests that enter by the gateway to a collector. What it does not take is dropped.
class span_exporter : public std::enable_shared_from_this<span_exporter> {
  public:
    span_exporter(cles::service& node, collector_address where, gateway_counts& counts,
                  std::function<void(const std::string&)> log);

    /// Begins the span of a request. \param parent what the client has stated
    struct begun {
        trace_parent trace{}; ///< that the request is sent with
        placed_span span{};
    };
    [[nodiscard]] begun begin(const trace_parent& parent, std::string name) const;
    /// It has ended: asks the nodes that have served it for their spans.
    void end(begun what, std::string_view outcome);

    void start() { send_later(); }
    void stop();

  private:
    class delivery;

    static boost::asio::awaitable<void> collect(std::shared_ptr<span_exporter> self, std::shared_ptr<begun> what);
    void send_later();
    void send();
    void on_sent(std::size_t count, const std::string& why);
    void add(const std::string& trace, placed_span span);

    cles::service* node_; // null: stopped
    collector_address where_;
    gateway_counts& counts_;
    std::function<void(const std::string&)> log_;
    boost::asio::steady_timer timer_;
    std::vector<traced_span> waiting_;
    std::shared_ptr<delivery> sending_;
    std::size_t collecting_ = 0;
    std::chrono::steady_clock::time_point logged_{};
};

} // namespace gateway
