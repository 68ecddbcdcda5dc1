// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/verb.hpp>

#include "core/deadlines.hpp"
#include "protocol/message.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

class inbound;
struct node;

/// A request whose handler answers later.
///
/// Whatever ends it first counts: the handler's answer, the deadline, a withdrawal, the loss of its link. After that
/// the handler is told to stop, and what it still says is ignored. It counts as running until the handler has let go of
/// it.
class call final : public deadline, public std::enable_shared_from_this<call> {
  public:
    struct terms {
        cles::verb verb = verb::pull;
        std::uint64_t id = 0;
        bool wants_reply = true;
        bool wants_progress = false;
        bool urgent = false;
        std::string publish_path{}; ///< of a request to publish: where
        std::string publish_body{};
    };

    call(std::shared_ptr<node> host, inbound& owner, terms wanted, time_point started);
    ~call();

    void done(std::string_view json);
    void fail(protocol::failure why);
    /// False where nobody listens (any more).
    bool progress(double fraction, std::string_view json);
    /// Runs once when the call is ended by anything but the handler; at once where it has been.
    void on_stop(std::function<void()> callback);
    [[nodiscard]] bool ended() const noexcept { return owner_ == nullptr; }
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }

    [[nodiscard]] const terms& wanted() const noexcept { return terms_; }
    [[nodiscard]] time_point started() const noexcept { return started_; }

  private:
    friend inbound;
    void on_deadline(time_point now) override;
    /// Cuts it off from its link and tells the handler.
    void stop();

    std::shared_ptr<node> node_; // the handler may outlive the service
    inbound* owner_;
    terms terms_;
    time_point started_;
    double reported_ = 0;
    std::function<void()> on_stop_;
    bool stopped_ = false;
};

} // namespace cles::core
