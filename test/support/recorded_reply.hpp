// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_reader.hpp>
#include <cles/pending.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::test {

/// How an operation ended, if it did.
struct outcome {
    bool ended = false;
    bool discarded = false; ///< it was destroyed without completing
    boost::system::error_code code{};
    std::string text{}; ///< the result, or the failure's message
};

/// An operation whose outcome is recorded. Like the real ones, it refuses results that are not JSON.
class recorded_reply final : public detail::pending {
  public:
    explicit recorded_reply(std::shared_ptr<outcome> to) : to_(std::move(to)) {}

    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        end({}, json);
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override { end(code, message); }
    void discard() noexcept override {
        to_->discarded = true;
        delete this;
    }

  private:
    void end(boost::system::error_code code, std::string_view text) {
        to_->ended = true;
        to_->code = code;
        to_->text = text;
        delete this;
    }

    std::shared_ptr<outcome> to_;
};

struct recorded_operation {
    detail::pending_ptr operation;
    std::shared_ptr<outcome> result;
};

inline recorded_operation record() {
    auto result = std::make_shared<outcome>();
    return {detail::pending_ptr{new recorded_reply(result)}, result};
}

} // namespace cles::test
