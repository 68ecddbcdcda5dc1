// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/call.hpp"
#include "core/deadlines.hpp"
#include "core/held_request.hpp"
#include "core/leg.hpp"
#include "core/local_request.hpp"
#include "core/routing.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cles::core {

/// A request for `all`: asks all who offer it at once, and answers with what each said, shortly before the time runs
/// out at the latest.
class gathering final : public routing::errand,
                        public leg_events,
                        private deadline,
                        public std::enable_shared_from_this<gathering> {
  public:
    gathering(std::shared_ptr<routing> by, const protocol::request_line& r, const identity& peer,
              std::shared_ptr<call> answers, time_point due);

    /// Asks them. False where it has to wait for others to be heard of.
    bool begin(time_point now) override;
    [[nodiscard]] bool over() const override { return call_->ended(); }

  private:
    struct part {
        std::string node;
        std::uint64_t ticket = 0;
        std::unique_ptr<local_request> here{};
        std::optional<std::string> result{};
        std::optional<protocol::failure> failure{};

        [[nodiscard]] bool is_open() const noexcept { return !result && !failure; }
    };

    void on_result(std::size_t leg, std::string_view json) override;
    void on_failure(std::size_t leg, leg_failure why) override;
    void on_progress(std::size_t leg, double fraction, std::string_view json) override;
    void on_deadline(time_point now) override;

    void ask_whom_is_known(time_point now);
    void ask_all(time_point now);
    void follow();
    void finish();
    void withdraw_open();

    std::shared_ptr<routing> routing_;
    held_request request_;
    const identity& peer_; // lives as long as the call has not ended
    std::shared_ptr<call> call_;
    time_point due_;
    time_point answer_by_{};
    std::vector<part> parts_; // by name
    std::size_t open_ = 0;
    std::size_t bytes_ = 0; // of results
    bool begun_ = false;
    bool has_waited_ = false; // as long as it may
    bool ended_ = false;
};

} // namespace cles::core
