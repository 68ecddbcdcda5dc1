// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "gateway/http/request_reader.hpp"
#include "gateway/serve/client_stream.hpp"
#include "gateway/serve/exchange.hpp"

#include <boost/asio/steady_timer.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace gateway {

/// How long a client may take.
struct patience {
    std::chrono::milliseconds handshake{10'000}; ///< of TLS
    std::chrono::milliseconds idle{75'000};      ///< until the next request begins
    std::chrono::milliseconds request{15'000};   ///< from its first byte to its last one
    std::chrono::milliseconds writing{30'000};   ///< for the next 64 KiB of a response
    std::chrono::milliseconds silence{15'000};  ///< of a stream, then a comment is sent, which shows whether it is read
    std::chrono::milliseconds lingering{2'000}; ///< for what a client still sends that has been refused
};

/// A connection of a client: its requests, one after another, and their responses.
class connection final : public response_sink, public std::enable_shared_from_this<connection> {
  public:
    /// \param changed called with whether a request is being served, when that changes. Once there is a response, it is
    /// the client's turn \param ended called when the connection has ended
    struct owner {
        std::function<void(bool is_busy)> changed;
        std::function<void()> ended;
    };
    connection(std::unique_ptr<client_stream> stream, request_handler& handler, gateway_counts& counts,
               const patience& limits, owner by);
    ~connection() = default;

    void start();
    /// Ends it at once.
    void close();

    void set_token(const std::string& hash) override;
    void respond(const http_response& response) override;
    void begin_events(const header_fields& fields) override;
    void send(std::string_view events) override;
    void end_events() override;

  private:
    enum class phase : std::uint8_t {
        handshake,
        reading,   ///< a request
        serving,   ///< until it is responded to
        streaming, ///< events
        ending,    ///< of a response, or a stream, after which nothing follows
        lingering,
        closed,
    };

    void read();
    void on_read(boost::system::error_code code, std::size_t size);
    void advance();
    void begin();
    [[nodiscard]] bool has_room(std::size_t size) const;
    [[nodiscard]] std::string no_room();
    void put(std::string_view text);
    void hold(std::size_t size);
    void release();
    void write();
    void on_written(boost::system::error_code code);
    void on_all_written();
    void next_request();
    void set_phase(phase next);
    void wait(std::chrono::milliseconds limit);
    void on_timeout();
    void on_gone();
    void count(int status);

    static constexpr std::size_t most_unread = 65'536; ///< of requests that follow the one that is served
    static constexpr std::size_t most_at_once = 65'536;
    static constexpr std::size_t most_unwritten = 64U << 20U; ///< of all clients
    static constexpr std::size_t most_of_token = 16U << 20U;  ///< of them

    std::unique_ptr<client_stream> stream_;
    request_handler& handler_;
    gateway_counts& counts_;
    const patience& limits_;
    owner owner_;
    boost::asio::steady_timer timer_;
    std::uint64_t waits_ = 0; // the timer's last wait
    request_reader reader_;
    std::shared_ptr<exchange> exchange_;
    phase phase_ = phase::handshake;
    bool keeps_alive_ = false;
    bool is_request_timed_ = false;
    bool is_reading_ = false;
    bool is_writing_ = false;
    std::array<char, 16'384> input_{};
    std::string output_;         // being written
    std::string waiting_;        // follows it
    std::size_t held_ = 0;       // of both
    std::string token_;          // for which they are held
    std::string_view permanent_; // follows both
    std::string_view unwritten_; // of what is being written
};

} // namespace gateway
