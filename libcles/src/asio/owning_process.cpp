// SPDX-License-Identifier: BSL-1.0
#include "asio/owning_process.hpp"

#include <boost/asio/execution/context.hpp>
#include <boost/asio/execution_context.hpp>
#include <boost/asio/query.hpp>

namespace cles::asio_port {
namespace asio = boost::asio;

namespace {

/// Shares the process, because services may outlive their context.
class process_service final : public asio::detail::execution_context_service_base<process_service> {
  public:
    explicit process_service(asio::execution_context& context) : execution_context_service_base(context) {}

    [[nodiscard]] const std::shared_ptr<owning_process>& process() const noexcept { return process_; }

  private:
    void shutdown() noexcept override {}
    void notify_fork(asio::execution_context::fork_event event) override {
        if (event == asio::execution_context::fork_child) {
            process_->become_this();
        }
    }

    std::shared_ptr<owning_process> process_ = std::make_shared<owning_process>();
};

} // namespace

std::shared_ptr<const owning_process> owning_process::of(const asio::any_io_executor& executor) {
    auto& context = asio::query(executor, asio::execution::context);
    return asio::use_service<process_service>(context).process();
}

} // namespace cles::asio_port
