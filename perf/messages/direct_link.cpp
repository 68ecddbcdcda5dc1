// SPDX-License-Identifier: BSL-1.0
#include "direct_link.hpp"

#include <boost/asio/post.hpp>

#include <utility>

namespace cles::perf {
namespace {

class direct_acceptor final : public acceptor {
  public:
    direct_acceptor(url where, std::shared_ptr<direct_exchange::places> places)
        : where_(std::move(where)), places_(std::move(places)) {}

    [[nodiscard]] url local() const override { return where_; }
    void start(std::function<void(link_ptr)> on_link) override { places_->on_link = std::move(on_link); }
    void close() override { places_->on_link = nullptr; }

  private:
    url where_;
    std::shared_ptr<direct_exchange::places> places_;
};

class direct_transport final : public link_transport {
  public:
    explicit direct_transport(std::shared_ptr<direct_exchange::places> places) : places_(std::move(places)) {}

    [[nodiscard]] bool is_exposed(const url&) const override { return false; }
    std::unique_ptr<acceptor> listen(const boost::asio::any_io_executor&, const url& where, const limits&) override {
        return std::make_unique<direct_acceptor>(where, places_);
    }
    std::function<void()> dial(const boost::asio::any_io_executor& executor, const url& where, const limits&,
                               dial_callback done) override {
        places_->dialled = std::make_shared<direct_link>(to_string(where));
        auto given_up = std::make_shared<bool>(false);
        boost::asio::post(executor, [given_up, made = places_->dialled, done = std::move(done)] {
            if (!*given_up) {
                done({}, made);
            }
        });
        return [given_up] { *given_up = true; };
    }

  private:
    std::shared_ptr<direct_exchange::places> places_;
};

} // namespace

direct_link::direct_link(std::string where)
    : peer_{.transport = "direct", .address = std::move(where), .name = {}, .uid = {}, .local = true} {}

void direct_link::deliver(std::string_view line) {
    received_ += line.size() + 1;
    owner_->on_line(line);
    owner_->on_batch();
}

void direct_link::flush() {
    if (!output_.empty()) {
        sent_ += output_.size();
        written_.swap(output_);
        output_.clear();
    }
}

direct_exchange::direct_exchange() : places_(std::make_shared<places>()) {
    register_transport("direct", std::make_unique<direct_transport>(places_));
}

std::shared_ptr<direct_link> direct_exchange::call() const {
    auto made = std::make_shared<direct_link>(url);
    places_->on_link(made);
    return made;
}

} // namespace cles::perf
