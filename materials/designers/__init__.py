"""Constants that designers of membrane structures type in, and the evaluation behind them."""
