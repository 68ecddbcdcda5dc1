// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/system/error_code.hpp>

#include <functional>
#include <memory>
#include <type_traits>
#include <utility>

namespace cles::transport {

/// A handler of Asio's operations that calls a member function of an object, which it keeps alive.
///
/// Asio compiles 1.5 to 2 kB of code for each operation and type of handler, and each lambda is a type of its own. This
/// is one type for all classes and functions.
class member_handler {
  public:
    /// `Function` is `void ()` or `void (error_code)`.
    template <auto Function, class Object>
    [[nodiscard]] static member_handler calling(std::shared_ptr<Object> object) noexcept {
        constexpr auto call = [](void* on, boost::system::error_code code) {
            if constexpr (std::is_invocable_v<decltype(Function), Object&>) {
                std::invoke(Function, *static_cast<Object*>(on));
            } else {
                std::invoke(Function, *static_cast<Object*>(on), code);
            }
        };
        return {std::move(object), call};
    }

    void operator()(boost::system::error_code code) const { call_(object_.get(), code); }

  private:
    using function = void (*)(void* on, boost::system::error_code code);

    member_handler(std::shared_ptr<void>&& object, function call) noexcept : object_(std::move(object)), call_(call) {}

    std::shared_ptr<void> object_;
    function call_;
};

// `async_wait` and `post` with such a handler. They are not templates of the source that uses them, since most of these
// are optimised for size, and messages wait for some.

/// `Device` is a UDP or stream socket, an acceptor of streams, or a descriptor.
template <class Device>
void wait(Device& device, typename Device::wait_type until, member_handler&& call);
void wait(boost::asio::steady_timer& timer, member_handler&& call);
void post(const boost::asio::any_io_executor& executor, member_handler&& call, boost::system::error_code code);

/// Calls a member function when the device is ready.
template <auto Function, class Device, class Object>
void wait_call(Device& device, typename Device::wait_type until, std::shared_ptr<Object> object) {
    wait(device, until, member_handler::calling<Function>(std::move(object)));
}

/// Calls a member function when the timer expires.
template <auto Function, class Object>
void wait_call(boost::asio::steady_timer& timer, std::shared_ptr<Object> object) {
    wait(timer, member_handler::calling<Function>(std::move(object)));
}

/// Calls a member function later, on the executor.
template <auto Function, class Object>
void post_call(const boost::asio::any_io_executor& executor, std::shared_ptr<Object> object,
               boost::system::error_code code = {}) {
    post(executor, member_handler::calling<Function>(std::move(object)), code);
}

} // namespace cles::transport
