// SPDX-License-Identifier: BSL-1.0
// What coroutines await with the default token: compiled here, so that their programs need not compile it. This file is
// compiled separately, because programs without coroutines do not link it.
#include <cles/awaited_event.hpp>
#include <cles/awaited_operation.hpp>
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/version.hpp>

#include <exception>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

namespace cles {
namespace asio = boost::asio;

namespace {

/// An `async_bind` that a coroutine awaits.
template <class Handler>
class awaited_binding final : public detail::binding {
  public:
    awaited_binding(Handler handler, const asio::any_io_executor& service, std::string* diagnostics,
                    detail::feed_owner& bound)
        : complete_(std::move(handler), service), diagnostics_(diagnostics), bound_(bound) {}

    verdict offer(std::string_view) override {
        bound_ = detail::feed_owner{take_control(), complete_.elsewhere()};
        end_operation(this, complete_, {}, {});
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        const std::string text{message}; // the view may refer to memory of the handler
        if (diagnostics_ != nullptr) {
            *diagnostics_ = text;
        }
        end_operation(this, complete_, code, text);
    }
    void discard() noexcept override { discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    detail::completion<true, Handler> complete_;
    std::string* diagnostics_;
    detail::feed_owner& bound_; ///< memory of the coroutine, which the handler owns
};

} // namespace

asio::awaitable<void> service::await_update(std::string noun, detail::outgoing_body json) {
    return initiate_plain(&service::start_update, asio::use_awaitable, std::move(noun), std::move(json));
}

asio::awaitable<void> service::await_close(std::chrono::milliseconds limit) {
    return initiate_plain(&service::start_close, asio::use_awaitable, limit);
}

asio::awaitable<void> service::await_bind(const std::string& noun, const bind_options& options,
                                          detail::feed_owner& bound) {
    return asio::async_initiate<decltype(asio::use_awaitable), void(std::exception_ptr)>(
        [this, &noun, &options, &bound](auto handler) {
            using operation_type = awaited_binding<decltype(handler)>;
            this->template start_bind<operation_type>(std::move(handler), noun, options, bound);
        },
        asio::use_awaitable);
}

#if BOOST_VERSION < 108900
using asio_handler = asio::detail::awaitable_async_op_handler<void(std::exception_ptr), asio::any_io_executor>;
template void detail::awaited_request::start(asio_handler handler);
template void detail::awaited_next::start(asio_handler handler);
#endif
template struct detail::reply_coroutine<json_text, call_options>;
template struct detail::reply_coroutine<json_text, std::reference_wrapper<const call_options>>;
template struct detail::bind_coroutine<json_text>;
template struct detail::next_coroutine<json_text>;

} // namespace cles
