// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include <memory>
#include <string_view>
#include <utility>

namespace cles::core {

/// An operation around another one, to which it passes its outcome. It is destroyed in any case when it ends: the
/// other one may call a handler that throws.
class wrapped_operation : public detail::pending {
  public:
    explicit wrapped_operation(detail::pending_ptr operation) noexcept : operation_(std::move(operation)) {}
    wrapped_operation(const wrapped_operation&) = delete;
    wrapped_operation& operator=(const wrapped_operation&) = delete;
    virtual ~wrapped_operation() = default;

    verdict offer(std::string_view json) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void discard() noexcept final { delete this; }
    [[nodiscard]] bool calls_user() const noexcept final { return operation_->calls_user(); }

  protected:
    /// Ends this, unless what `offer` gives to the other operation is malformed: then both stay pending.
    template <class Offer>
    verdict pass_on(Offer offer) {
        std::unique_ptr<wrapped_operation> self{this};
        auto* const operation = operation_.release();
        const auto found = offer(*operation);
        if (found == verdict::malformed) {
            operation_.reset(operation);
            static_cast<void>(self.release());
        }
        return found;
    }
    /// The other operation, which the caller ends.
    [[nodiscard]] detail::pending_ptr take_operation() noexcept { return std::move(operation_); }

  private:
    detail::pending_ptr operation_;
};

} // namespace cles::core
