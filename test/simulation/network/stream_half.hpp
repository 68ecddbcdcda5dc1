// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include "protocol/line.hpp"
#include "simulation/network/link_security.hpp"
#include "simulation/network/network.hpp"
#include "simulation/network/place.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace cles::simulation {

/// One end of a simulated stream, which guarantees what transport/stream_link.hpp does: bytes arrive in order, split
/// anywhere; the system accepts a limited amount while the peer does not read; it can be half-closed, closed and reset.
class stream_half final : public link, public std::enable_shared_from_this<stream_half> {
  public:
    static constexpr std::size_t window = 16384; ///< bytes in transit or not yet read

    stream_half(network& net, const std::shared_ptr<place>& home, const limits& bounds, unsigned peer_host);
    ~stream_half() override;
    static std::pair<std::shared_ptr<stream_half>, std::shared_ptr<stream_half>>
    make(network& net, const std::shared_ptr<place>& near, const limits& near_bounds, const std::shared_ptr<place>& far,
         const limits& far_bounds);

    /// With security: admits the peer first. Until then, no line is delivered or sent. `opened` may be empty.
    void open(link_security& own, std::string_view expected, std::function<void(bool admitted)> opened);
    void start(std::shared_ptr<link_events> owner) override;
    std::string& output() override { return output_; }
    std::string& urgent_output() override { return urgent_; }
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override {
        return net_.fault() == planted::never_full ? 0 : held();
    }
    /// The bytes that it holds for its peer, even if a planted fault reports otherwise.
    [[nodiscard]] std::size_t held() const noexcept {
        return urgent_.size() + output_.size() + sending_.size() - sending_at_;
    }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return sent_; }
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    void pause(bool stop) override;
    void finish() override;
    void close() override;
    [[nodiscard]] const identity& peer() const noexcept override { return who_; }
    [[nodiscard]] std::string_view epoch() const noexcept override {
        return gate_ && !opening_ ? gate_->epoch() : std::string_view{};
    }

    /// Shuts down the sending side, and continues to read.
    void half_close();
    /// The network resets it, at both ends.
    void cut();
    [[nodiscard]] bool is_open() const noexcept { return state_ == state::open && !severed_; }
    [[nodiscard]] bool was_cut() const noexcept { return severed_; }

  private:
    enum class state : std::uint8_t { open, finishing, discarding, closed };

    void arrive(std::string_view bytes);
    void arrive_end();
    void arrive_reset();
    void taken(std::size_t bytes);

    void call_later(std::chrono::nanoseconds by, void (stream_half::*what)());
    bool fill();
    void admit();
    void on_admitted();
    void hand_over();
    void report_updates(std::string_view lines);
    bool hand_over_batch();
    void transmit(std::string_view bytes);
    void transmit_end();
    void reset_peer();
    [[nodiscard]] std::size_t free_window() const noexcept { return window - std::min(window, in_flight_); }
    void write_rest();
    void end_sending();
    void lose();
    void tamper();
    [[nodiscard]] time_point in_order(time_point when) noexcept { return last_ = std::max(last_, when); }

    network& net_;
    std::weak_ptr<place> home_;
    unsigned host_;
    unsigned peer_host_;
    std::string name_; // in the trace
    identity who_;
    limits bounds_;
    protocol::line_buffer input_;
    std::weak_ptr<stream_half> peer_;
    std::shared_ptr<link_events> owner_;
    std::string output_;
    std::string urgent_; // sent before that
    std::string sending_;
    std::size_t sending_at_ = 0;
    std::size_t in_flight_ = 0; // sent, and not yet read by the peer
    time_point last_{};         // when the last of it arrives
    std::string inbox_;         // arrived, and not yet read
    std::size_t inbox_at_ = 0;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
    state state_ = state::open;
    bool paused_ = false;
    bool handing_ = false;
    bool lines_left_ = false; // of what has been read
    bool blocked_ = false;    // waits until the window opens
    bool ended_ = false;
    bool told_end_ = false;
    bool overlong_ = false;
    bool shut_ = false; // the sending side
    bool severed_ = false;
    std::unique_ptr<stream_gate> gate_; // null: without security
    std::function<void(bool)> opened_;
    bool opening_ = false;   // the peer has not been admitted yet
    bool removed_ = false;   // the peer or this end: nothing is delivered or sent any more
    bool in_routes_ = false; // what arrives next
};

} // namespace cles::simulation
