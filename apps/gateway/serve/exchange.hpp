// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "gateway/http/message.hpp"

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace gateway {

/// What the gateway has counted since its start: the member `gateway` of its metrics (docs/metrics.md).
struct gateway_counts {
    std::uint64_t connections_open = 0;
    std::uint64_t connections_accepted = 0;
    std::uint64_t connections_refused = 0;
    std::uint64_t connections_evicted = 0;
    std::uint64_t streams_open = 0;
    std::uint64_t events_sent = 0;
    std::uint64_t updates_missed = 0;
    std::uint64_t streams_cut = 0;
    std::uint64_t clients_gone = 0;
    std::uint64_t responses_2xx = 0;
    std::uint64_t responses_4xx = 0;
    std::uint64_t responses_5xx = 0;
    std::uint64_t denied = 0;
    std::uint64_t timeouts = 0;
    std::uint64_t spans_sent = 0;
    std::uint64_t spans_dropped = 0;
    /// Bytes that wait for all clients, and for those with each token, by its hash; no metrics.
    std::size_t unwritten = 0;
    std::map<std::string, std::size_t> unwritten_of{};
};
BOOST_DESCRIBE_STRUCT(gateway_counts, (),
                      (connections_open, connections_accepted, connections_refused, connections_evicted, streams_open,
                       events_sent, updates_missed, streams_cut, clients_gone, responses_2xx, responses_4xx,
                       responses_5xx, denied, timeouts, spans_sent, spans_dropped))

/// The client of a request: where its response goes. It is responded to once, as a whole or as a stream.
class response_sink {
  public:
    response_sink() = default;
    response_sink(const response_sink&) = delete;
    response_sink& operator=(const response_sink&) = delete;

    /// \param hash of the token that the request has, whose share limits what waits; empty: it needs none
    virtual void set_token(const std::string& hash) = 0;
    virtual void respond(const http_response& response) = 0;
    /// Begins a stream of server-sent events. \param fields further ones of the response
    virtual void begin_events(const header_fields& fields) = 0;
    /// A part of the stream, which waits until it can be written. If there is no room for it, the stream ends with a
    /// failure, and the exchange is cancelled before this returns.
    virtual void send(std::string_view events) = 0;
    virtual void end_events() = 0;

  protected:
    ~response_sink() = default;
};

/// A request that is being answered.
class exchange {
  public:
    exchange() = default;
    exchange(const exchange&) = delete;
    exchange& operator=(const exchange&) = delete;
    virtual ~exchange() = default;

    /// The client is gone, and nothing that is sent to it arrives.
    virtual void cancel() = 0;
    /// All that was sent of a stream has been written.
    virtual void on_writable() {}
    /// Nothing has been sent of a stream for a while.
    virtual void on_silence() {}
};

/// What answers requests.
class request_handler {
  public:
    request_handler() = default;
    request_handler(const request_handler&) = delete;
    request_handler& operator=(const request_handler&) = delete;

    /// The response that ends a request before its body is read; nothing if it is to be read.
    virtual std::optional<http_response> response_to_head(const http_request& head) = 0;
    /// Answers a whole request, now or later. \return what is still to be answered; null if nothing is
    virtual std::shared_ptr<exchange> begin(const http_request& request, const std::shared_ptr<response_sink>& to) = 0;

  protected:
    ~request_handler() = default;
};

} // namespace gateway
