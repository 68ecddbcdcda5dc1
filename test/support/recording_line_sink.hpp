// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/session/line_sink.hpp"

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace cles::test {

/// A link as a session sees it, which records its output and calls.
class recording_line_sink : public core::line_sink {
  public:
    explicit recording_line_sink(std::size_t datagram = 0, std::shared_ptr<core::memory_account> memory = nullptr)
        : datagram_bytes(datagram), account(std::move(memory)), held_(account) {}

    std::string& output() override { return text_; }
    std::string& urgent_output() override { return datagram_bytes == 0 ? urgent_ : text_; }
    [[nodiscard]] std::size_t datagram() const noexcept override { return datagram_bytes; }
    [[nodiscard]] std::shared_ptr<core::memory_account> memory() const override { return account; }
    [[nodiscard]] bool reserve(std::size_t more) override {
        return held_.try_resize(text_.size() + urgent_.size() + more);
    }
    void wake() override { ++wakes; }
    [[nodiscard]] bool is_behind() const override { return behind; }
    void pause(bool stop) override {
        paused = stop;
        ++pauses;
    }
    void finish() override { ++finishes; }
    void close() override { ++closes; }
    void retire() override { ++retires; }
    void check_peer(time_point since) override { checks.push_back(since); }

    /// What a link does before it sends: lets waiting requests be served.
    virtual void turn() {}
    /// What has been sent since the last call.
    std::string take() {
        turn();
        held_.resize(0);
        return std::exchange(urgent_, {}) + std::exchange(text_, {});
    }
    /// The size of the output that has not been sent.
    [[nodiscard]] std::size_t unsent() const { return text_.size() + urgent_.size(); }
    /// What a link does after each batch: accounts for what the peer has not accepted.
    void settle() { held_.resize(unsent()); }
    /// The same, line by line and without LF. A last line without LF appears as "... <no LF>".
    std::vector<std::string> take_lines() {
        std::vector<std::string> lines;
        const auto text = take();
        for (std::size_t from = 0; from < text.size();) {
            const auto end = text.find('\n', from);
            if (end == std::string::npos) {
                lines.push_back(text.substr(from) + " <no LF>");
                break;
            }
            lines.push_back(text.substr(from, end - from));
            from = end + 1;
        }
        return lines;
    }

    int wakes = 0;
    int pauses = 0;
    int finishes = 0;
    int closes = 0;
    int retires = 0;
    std::vector<time_point> checks; ///< of the peer
    bool paused = false;
    bool behind = false;
    std::size_t datagram_bytes = 0;                ///< 0: a stream
    std::shared_ptr<core::memory_account> account; ///< null: not counted

  protected:
    ~recording_line_sink() = default;

  private:
    std::string text_;
    std::string urgent_; // sent before it
    core::memory_reservation held_;
};

} // namespace cles::test
