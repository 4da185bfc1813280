"""The agent of HANNA: the model of dissertation appendix D.2 and the LSTM baseline of Table 4.6."""
