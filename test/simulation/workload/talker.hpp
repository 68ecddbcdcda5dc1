// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include "simulation/network/dice.hpp"
#include "simulation/network/network.hpp"
#include "simulation/network/place.hpp"
#include "simulation/network/stream_half.hpp"

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

/// A client on a stream that sends requests without ids, and knows which answer has to come next.
class talker final : public place, public link_events {
  public:
    enum class ending : std::uint8_t { stays, half_closes, leaves };
    struct manner {
        unsigned to = 0;
        std::uint32_t first_op = 0; ///< its requests bear this number and those after it
        unsigned lines = 0;
        std::chrono::milliseconds gap{0};  ///< between its lines
        std::chrono::milliseconds slow{0}; ///< for so long it does not read
        ending end = ending::stays;
    };

    talker(network& net, unsigned host, dice style, manner how, const limits& bounds);

    void start();
    /// The node that it talks to has crashed, and what is open stays open; or it may end the stream.
    void excuse() noexcept { excused_ = true; }
    [[nodiscard]] unsigned to() const noexcept { return how_.to; }
    /// What was to be answered has been, unless its stream was lost. Then it leaves.
    void judge_and_leave();

    void on_line(std::string_view line) override;
    void on_overlong(std::string_view head) override;
    void on_batch() override {}
    void on_end() override;
    void on_lost(boost::system::error_code why) override;
    void on_room() override {}

  private:
    enum class kind : std::uint8_t { result, failure, unknown, malformed, bound };
    struct expected {
        kind what;
        std::uint32_t op;
        std::string noun; // that was bound
    };

    void say_next();
    void say_any(const std::string& op, const std::string& node);
    void say(const std::string& line, kind what, std::string noun = {});
    void end_talk();
    void on_update(std::string_view line);
    void on_answer(const expected& e, std::string_view line);
    void complain(rule which, const std::string& what) { net_.watcher().broken(which, name() + ": " + what); }

    network& net_;
    dice style_;
    manner how_;
    limits bounds_;
    bool is_greedy_; ///< asks for much
    std::shared_ptr<stream_half> link_;
    std::deque<expected> expected_;
    std::map<std::string, std::uint64_t> bound_; // the last seq of each noun
    unsigned said_ = 0;
    bool excused_ = false;
    bool over_ = false;
};

} // namespace cles::simulation
