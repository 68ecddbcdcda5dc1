// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed.hpp>

#include <array>
#include <atomic>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

/// Events of a feed in batches. Include this to call `feed::async_next_batch`.

namespace cles {

namespace detail {

/// The events of a batch. The memory is used again when the batch that holds it has been destroyed, on whatever thread.
template <class T>
struct batch_block {
    std::vector<feed_item<T>> items;
    std::atomic<bool> is_used{false};
};

/// The memory for the batches of a feed. There are two, for a handler that waits for the next batch while it has one;
/// beyond that, batches have memory of their own.
template <class T>
class batch_memory {
  public:
    std::shared_ptr<batch_block<T>> take() {
        for (auto& each : blocks_) {
            if (each == nullptr) {
                each = std::make_shared<batch_block<T>>();
            }
            if (!each->is_used.exchange(true, std::memory_order_acquire)) {
                return each;
            }
        }
        return std::make_shared<batch_block<T>>();
    }

  private:
    std::array<std::shared_ptr<batch_block<T>>, 2> blocks_;
};

} // namespace detail

/// Events of a feed, in the order in which they arrived: a range that converts to `std::span<const feed_item<T>>`.
///
/// It owns the events, and may outlive the feed. The feed uses the memory again after the batch has been destroyed.
template <class T>
class feed_batch {
  public:
    using value_type = feed_item<T>;
    using iterator = feed_item<T>*;
    using const_iterator = const feed_item<T>*;

    feed_batch() noexcept = default;
    /// An empty one, with this memory, which nothing else uses.
    explicit feed_batch(std::shared_ptr<detail::batch_block<T>> memory) noexcept : memory_(std::move(memory)) {}
    feed_batch(feed_batch&& other) noexcept : memory_(std::move(other.memory_)) {}
    feed_batch& operator=(feed_batch&& other) noexcept {
        if (this != &other) {
            release();
            memory_ = std::move(other.memory_);
        }
        return *this;
    }
    feed_batch(const feed_batch&) = delete;
    feed_batch& operator=(const feed_batch&) = delete;
    ~feed_batch() { release(); }

    [[nodiscard]] std::size_t size() const noexcept { return memory_ ? memory_->items.size() : 0; }
    [[nodiscard]] bool empty() const noexcept { return size() == 0; }
    [[nodiscard]] iterator data() noexcept { return memory_ ? memory_->items.data() : nullptr; }
    [[nodiscard]] const_iterator data() const noexcept { return memory_ ? memory_->items.data() : nullptr; }
    [[nodiscard]] iterator begin() noexcept { return data(); }
    [[nodiscard]] const_iterator begin() const noexcept { return data(); }
    [[nodiscard]] iterator end() noexcept { return data() + size(); }
    [[nodiscard]] const_iterator end() const noexcept { return data() + size(); }
    [[nodiscard]] feed_item<T>& operator[](std::size_t index) noexcept { return data()[index]; }
    [[nodiscard]] const feed_item<T>& operator[](std::size_t index) const noexcept { return data()[index]; }

    /// Reads an event as its last item; for the library. \pre it has memory
    detail::pending_batch::verdict keep(const detail::raw_event& event, boost::system::error_code& code,
                                        std::string& why) {
        using verdict = detail::pending_batch::verdict;
        if (code) {
            return verdict::full;
        }
        auto& items = memory_->items;
        auto& item = items.emplace_back();
        bool is_json = false;
        try {
            is_json = detail::fill(event, item, code, why);
        } catch (...) { // of the conversion
            items.pop_back();
            throw;
        }
        if (is_json && !code) {
            return verdict::kept;
        }
        items.pop_back();
        if (!is_json) {
            return verdict::malformed;
        }
        if (items.empty()) {
            return verdict::kept;
        }
        code.clear();
        why.clear();
        return verdict::full;
    }

  private:
    void release() noexcept {
        if (const auto memory = std::move(memory_)) {
            constexpr std::size_t roomy = 65536; // bytes; more are not kept
            auto& items = memory->items;
            items.clear();
            if (items.capacity() > roomy / sizeof(feed_item<T>)) {
                std::vector<feed_item<T>>{}.swap(items);
            }
            memory->is_used.store(false, std::memory_order_release);
        }
    }

    std::shared_ptr<detail::batch_block<T>> memory_;
};

namespace detail {

template <class T, bool Throws, class Handler>
class batch_operation final : public pending_batch {
  public:
    batch_operation(Handler handler, const boost::asio::any_io_executor& service,
                    const std::shared_ptr<batch_memory<T>>& memory)
        : complete_(std::move(handler), service), batch_(memory->take()) {}

    verdict keep(const raw_event& event) override { return batch_.keep(event, code_, why_); }
    void complete() override {
        const std::string why = std::move(why_);
        auto batch = std::move(batch_);
        detail::end_operation(this, complete_, code_, why, std::move(batch));
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        detail::end_operation(this, complete_, code, std::string{message}, feed_batch<T>{});
    }
    void discard() noexcept override { detail::discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    completion<Throws, Handler> complete_;
    feed_batch<T> batch_;
    boost::system::error_code code_; // why the only event cannot be read
    std::string why_;
};

template <class T>
struct needs_feed_batch_hpp {
    template <class Token>
    static auto next(feed_owner& owner, Token&& token) {
        if constexpr (!detail::fits_token<Token, feed_batch<T>>()) {
            return detail::refuse_call<Token, feed_batch<T>>();
        } else {
            auto& memory = owner.batch_memory();
            if (memory == nullptr) {
                memory = std::make_shared<batch_memory<T>>();
            }
            return boost::asio::async_initiate<Token, signature_for<Token, feed_batch<T>>>(
                [from = owner.source(), kept = std::static_pointer_cast<batch_memory<T>>(memory)](auto handler) {
                    constexpr bool with_exceptions = throws<std::remove_cvref_t<Token>>;
                    if (!from.control) {
                        detail::fail_later<with_exceptions>(std::move(handler), from.fallback, errc::closed, not_open,
                                                            feed_batch<T>{});
                        return;
                    }
                    using operation_type = batch_operation<T, with_exceptions, decltype(handler)>;
                    detail::start_next<operation_type>(from, std::move(handler), kept);
                },
                token);
        }
    }
};

} // namespace detail

} // namespace cles
