// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/update_mark.hpp>

#include <cstddef>
#include <cstdint>
#include <string_view>

/// The interface between completion handlers of any type, which are templates, and the service, which is not. Not for
/// applications.

namespace cles::detail {

/// The maximum depth of brackets in a reply.
inline constexpr std::size_t answer_depth = json_writer::most_levels;
inline bool is_valid_answer(std::string_view json) { return is_valid_json(json, answer_depth); }
/// The same for an answer that becomes a part of the answer of `all`, inside of two more brackets.
inline bool is_valid_part(std::string_view json) { return is_valid_json(json, answer_depth - 2); }

/// A pending operation. Its owner ends it once, with `offer`, `fail` or `discard`, which destroy it.
class pending {
  public:
    pending() = default;
    pending(const pending&) = delete;
    pending& operator=(const pending&) = delete;

    enum class verdict : std::uint8_t { completed, malformed };

    /// Completes with the text of the result. `malformed`: it is not JSON, and the operation stays pending, for a
    /// later reply or its deadline.
    [[nodiscard]] virtual verdict offer(std::string_view json) = 0;
    /// As `offer`, for a reply to BIND that says which update it contains.
    [[nodiscard]] virtual verdict offer_marked(std::string_view json, const update_mark& mark) {
        static_cast<void>(mark);
        return offer(json);
    }
    /// As `offer`, for a reply with which the peer grants a slot (<cles/sharing.hpp>).
    [[nodiscard]] virtual verdict offer_granted(std::string_view json, std::uint64_t /*grant*/) { return offer(json); }
    virtual void fail(boost::system::error_code code, std::string_view message) = 0;
    /// As `fail`, for a failure reported by the peer; `answer` is its whole reply.
    virtual void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) {
        static_cast<void>(answer);
        fail(code, message);
    }
    /// Destroys it without calling its handler, as Asio does when an execution context is destroyed.
    virtual void discard() noexcept = 0;
    /// Whether it calls a handler of the user; otherwise it belongs to the library.
    [[nodiscard]] virtual bool calls_user() const noexcept { return true; }

  protected:
    ~pending() = default;
};

/// Owns an operation until it is completed; discards it otherwise. A `std::unique_ptr` would do, but takes every user
/// of the library much longer to compile.
template <class Operation>
class operation_ptr {
  public:
    operation_ptr() = default;
    operation_ptr(std::nullptr_t) noexcept {} // NOLINT(google-explicit-constructor): as a pointer
    explicit operation_ptr(Operation* operation) noexcept : operation_(operation) {}
    operation_ptr(operation_ptr&& other) noexcept : operation_(other.release()) {}
    operation_ptr& operator=(operation_ptr&& other) noexcept {
        reset(other.release());
        return *this;
    }
    operation_ptr(const operation_ptr&) = delete;
    operation_ptr& operator=(const operation_ptr&) = delete;
    ~operation_ptr() { reset(); }

    [[nodiscard]] Operation* get() const noexcept { return operation_; }
    [[nodiscard]] Operation* release() noexcept {
        auto* operation = operation_;
        operation_ = nullptr;
        return operation;
    }
    Operation* operator->() const noexcept { return operation_; }
    Operation& operator*() const noexcept { return *operation_; }
    explicit operator bool() const noexcept { return operation_ != nullptr; }
    bool operator==(std::nullptr_t) const noexcept { return operation_ == nullptr; }

    void reset(Operation* next = nullptr) noexcept {
        auto* const before = operation_;
        operation_ = next;
        if (before != nullptr) {
            before->discard();
        }
    }

  private:
    Operation* operation_ = nullptr;
};
using pending_ptr = operation_ptr<pending>;

} // namespace cles::detail
