// SPDX-License-Identifier: BSL-1.0
#include "transport/inproc.hpp"

#include <cles/error.hpp>

#include "transport/inproc_link.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>

#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace cles::transport {
namespace asio = boost::asio;

namespace {

class inproc_acceptor;

// Where dialling threads leave their links for a listener.
struct doorway {
    doorway(asio::any_io_executor where, url address) : executor(std::move(where)), local(std::move(address)) {}

    const asio::any_io_executor executor;
    const url local;
    // Both are used on the executor only.
    std::function<void(link_ptr)> on_link{};
    bool closed = false;

    void come_in(link_ptr arrived) {
        if (closed || !on_link) {
            arrived->close();
        } else {
            on_link(std::move(arrived));
        }
    }
};

// The listeners of the process by name; services may be made on several threads.
class doorways {
  public:
    bool add(const std::shared_ptr<doorway>& door) {
        const std::lock_guard lock{mutex_};
        auto& place = doors_[door->local.host];
        if (!place.expired()) {
            return false;
        }
        place = door;
        return true;
    }
    void remove(const std::shared_ptr<doorway>& door) {
        const std::lock_guard lock{mutex_};
        const auto found = doors_.find(door->local.host);
        if (found != doors_.end() && found->second.lock() == door) {
            doors_.erase(found);
        }
    }
    std::shared_ptr<doorway> find(const std::string& name) {
        const std::lock_guard lock{mutex_};
        const auto found = doors_.find(name);
        return found == doors_.end() ? nullptr : found->second.lock();
    }

  private:
    std::mutex mutex_;
    std::map<std::string, std::weak_ptr<doorway>> doors_;
};

doorways& all_doorways() {
    static doorways instance;
    return instance;
}

class inproc_acceptor final : public acceptor {
  public:
    explicit inproc_acceptor(std::shared_ptr<doorway> door) : door_(std::move(door)) {}
    ~inproc_acceptor() override { close(); }

    [[nodiscard]] url local() const override { return door_->local; }
    void start(std::function<void(link_ptr)> on_link) override { door_->on_link = std::move(on_link); }
    void close() override {
        all_doorways().remove(door_);
        door_->closed = true;
        door_->on_link = nullptr;
    }

  private:
    std::shared_ptr<doorway> door_;
};

class inproc_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url&) const override { return false; }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where, const limits&) override {
        auto door = std::make_shared<doorway>(executor, where);
        if (!all_doorways().add(door)) {
            throw boost::system::system_error{asio::error::address_in_use};
        }
        return std::make_unique<inproc_acceptor>(std::move(door));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        auto given_up = std::make_shared<bool>(false);
        auto give_up = [given_up] { *given_up = true; };
        const auto door = all_doorways().find(where.host);
        if (!door) {
            asio::post(executor, [given_up, done = std::move(done)] {
                if (!*given_up) {
                    done(asio::error::connection_refused, nullptr);
                }
            });
            return give_up;
        }
        const auto near = std::make_shared<inproc_link>(executor, to_string(where), bounds);
        const auto far = std::make_shared<inproc_link>(door->executor, to_string(where), bounds);
        inproc_link::join(near, far);
        asio::post(door->executor, [door, far] { door->come_in(far); });
        asio::post(executor, [given_up, near, done = std::move(done)] {
            if (*given_up) {
                near->close();
            } else {
                done({}, near);
            }
        });
        return give_up;
    }
};

} // namespace

bool is_open(const std::string& name) { return all_doorways().find(name) != nullptr; }

std::unique_ptr<link_transport> make_inproc() { return std::make_unique<inproc_transport>(); }

} // namespace cles::transport
