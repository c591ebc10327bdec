"""Sweep of named numbers: what does half or double of each change?"""
