"""The languages of the program: ``language`` reads their entries (``de.po``, ``fr.po``), and says messages in them."""
