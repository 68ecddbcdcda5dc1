// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/update_mark.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

/// The seam between completion handlers of any type, which are templates, and the service, which is not. Not for
/// applications.

namespace cles::detail {

/// How many brackets deep an answer may be: as deep as a body by default, and what may be wrapped around it.
inline constexpr std::size_t answer_depth = 32 + 3;
inline bool is_valid_answer(std::string_view json) { return is_valid_json(json, answer_depth); }

/// One operation that waits for its result. Its holder has it ended once, by `offer`, `fail` or `discard`, which
/// consume it.
class pending {
  public:
    pending() = default;
    pending(const pending&) = delete;
    pending& operator=(const pending&) = delete;

    enum class verdict : std::uint8_t { completed, malformed };

    /// Offers the result's text. `malformed`: it is not JSON, and the operation goes on waiting.
    virtual verdict offer(std::string_view json) = 0;
    /// The same for an answer to BIND that says which update it bears.
    virtual verdict offer_marked(std::string_view json, const update_mark& mark) {
        static_cast<void>(mark);
        return offer(json);
    }
    virtual void fail(boost::system::error_code code, std::string_view message) = 0;
    /// The same where the peer itself said so; `answer` is the whole of what it said.
    virtual void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) {
        static_cast<void>(answer);
        fail(code, message);
    }
    /// Destroys it without calling its handler, as Asio does when an execution context goes.
    virtual void discard() noexcept = 0;
    /// Whether its end calls a handler of the user's; else it is the library's own.
    [[nodiscard]] virtual bool calls_user() const noexcept { return true; }

  protected:
    ~pending() = default;
};

struct discarding {
    template <class Operation>
    void operator()(Operation* operation) const noexcept {
        operation->discard();
    }
};

/// Owns an operation until it has been completed.
using pending_ptr = std::unique_ptr<pending, discarding>;

} // namespace cles::detail
