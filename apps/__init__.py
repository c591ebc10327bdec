"""Applications over the public interface: batches of sheets, pages in the browser."""
